"""Notes of the candidates that were not looked for: those that the user can have looked for, in one line.

What a machine of another kind has is not told: soil under a robot's joint, slopes where there is no vehicle. The whole
list is `sensitivity` in the answer, and what `regolithd mismatch --effects --simulation SIM.toml` prints.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.candidates.candidate import UNITS_OF_NO_LOAD
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.inference.statements import listed
from regolithd.calibration.mismatch.problem.covariates import FOLLOW_SPEED

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate
    from regolithd.calibration.mismatch.problem.problem import Problem

OF_A_VEHICLE = frozenset({"pitch", "roll", "yaw_rate", "slip", "wheel_row"})
"""Covariates of a vehicle: a machine that has none of them is none, and lacks no effect that depends on them."""
OF_THE_SPEED = frozenset({*FOLLOW_SPEED, "wheel_speed", "torque"})
"""Covariates that a machine without a speed does not have: what it carries is no torque."""
WITHOUT_SPEED = "friction, drag, losses, inertia and ripples"
"""What needs a speed."""


def not_looked_for(problem: Problem, candidates: Sequence[Candidate], applicable: Collection[str]) -> list[str]:
    """Return at most two notes: what is missing (also to candidates of the user's own), and a unit of no load."""
    of_library, unit = {each.name for each in library()}, problem.simulation.unit
    no_load = unit in UNITS_OF_NO_LOAD
    by_missing: dict[str, list[str]] = {}
    no_loads = []
    for candidate in candidates:
        if candidate.name in applicable or not _can_have(candidate, problem):
            continue
        missing = _missing(candidate, problem)
        if missing and not (no_load and (candidate.loads or missing == ["wheel_speed"])):
            by_missing.setdefault(listed(missing), []).append(candidate.name)
        elif not missing and candidate.loads and no_load:
            no_loads.append(candidate.name)
        elif not missing and candidate.name not in of_library:
            by_missing.setdefault(candidate.needs or "what `applies` asks for", []).append(candidate.name)
    if "wheel_speed" in by_missing:
        by_missing["wheel_speed"] = [WITHOUT_SPEED]
    parts = [f"without {needs}: {', '.join(names)}" for needs, names in by_missing.items()]
    return [
        *([f"Not looked for {'; '.join(parts)}."] if parts else []),
        *([f"Not looked for, as {unit} is no unit of a load: {', '.join(no_loads)}."] if no_loads else []),
    ]


def _missing(candidate: Candidate, problem: Problem) -> list[str]:
    """Return the covariates that a candidate lacks; of a machine whose speed nobody gave, the speed alone."""
    absent = [name for name in candidate.requires if name not in problem.covariates]
    if _unknown("wheel_speed", problem) and OF_THE_SPEED.intersection(absent):
        return ["wheel_speed"]
    return [f"{name} that varies" if name in problem.constants else name for name in absent]


def _unknown(name: str, problem: Problem) -> bool:
    return name not in problem.covariates and name not in problem.constants


def _can_have(candidate: Candidate, problem: Problem) -> bool:
    """Return whether the effect is none of a vehicle's, or the machine is one."""
    is_vehicle = problem.row is not None or any(not _unknown(name, problem) for name in OF_A_VEHICLE)
    return is_vehicle or OF_A_VEHICLE.isdisjoint({candidate.covariate, *candidate.requires})
