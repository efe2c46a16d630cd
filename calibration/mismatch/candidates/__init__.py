"""Physics that a simulation may leave out: one small file for each effect.

A new one is a subclass of `Candidate` in a file of its own here, or anywhere for a simulation's own `candidates()`.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from regolithd.calibration.mismatch.candidates.candidate import Candidate, Coefficient, Shape

__all__ = ["Candidate", "Coefficient", "Shape", "library"]


@cache
def library() -> tuple[Candidate, ...]:
    """Return every candidate in this folder, in alphabetical order."""
    found: list[Candidate] = []
    for module in sorted(pkgutil.iter_modules(__path__), key=lambda m: m.name):
        members = vars(importlib.import_module(f"{__name__}.{module.name}")).values()
        found += [
            kind()
            for kind in members
            if isinstance(kind, type) and issubclass(kind, Candidate) and kind.__module__.endswith(f".{module.name}")
            if kind is not Candidate
        ]
    return tuple(found)
