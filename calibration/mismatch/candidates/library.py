"""The library: every candidate of this folder, and what a simulation makes of it."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from regolithd.calibration.mismatch import candidates
from regolithd.calibration.mismatch.candidates.candidate import Candidate


@cache
def library() -> tuple[Candidate, ...]:
    """Return every candidate in this folder, in alphabetical order of the files.

    A class derived from another candidate is a form of it for other machines (`Candidate.form_for`), none of its own.
    """
    found: list[Candidate] = []
    for module in sorted(pkgutil.iter_modules(candidates.__path__), key=lambda m: m.name):
        members = vars(importlib.import_module(f"{candidates.__name__}.{module.name}")).values()
        found += [
            kind()
            for kind in members
            if isinstance(kind, type) and Candidate in kind.__bases__ and kind.__module__.endswith(f".{module.name}")
        ]
    return tuple(found)
