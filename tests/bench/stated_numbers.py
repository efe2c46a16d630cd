"""Compares constants of modules with numbers that a test states: those of a standard, or that a user notices."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping


def differing(package: str, stated: Mapping[str, Mapping[str, object]]) -> dict[str, object]:
    """Return the constants that are not as stated, by `module.NAME`, with their value."""
    found = {
        f"{module}.{name}": (getattr(import_module(f"regolithd.{package}.{module}"), name), value)
        for module, values in stated.items()
        for name, value in values.items()
    }
    return {name: actual for name, (actual, value) in found.items() if actual != value}
