"""Current that accelerates rotor, gears and wheel."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem


MOST_READINGS = 4
"""Largest lag of the current in readings (a choice)."""
LAGS = (0.0, 0.5, 1.5)
"""Lags that are searched, in readings (a choice)."""


class RotorInertia(Candidate):
    """Current in proportion to the acceleration; the rotor's inertia times the gear ratio squared dominates.

    The current may lag behind the acceleration: drivetrains are elastic, and controllers low-pass what they report.
    The acceleration is the derivative of `wheel_speed` unless the simulation gives another; noise in it makes the
    inertia too small.
    """

    name = "rotor-inertia"
    covariate = "wheel_acceleration"
    equation = "Δy(t) = (J/k) dω/dt (t − lag)"
    words = "inertia of the parts that move"
    signature = "short residuals at each change of speed, with the acceleration's sign"
    experiment = "start, stop and reverse sharply, twenty times"
    experiment_one_way = "start and stop sharply, twenty times"
    vary: ClassVar = ("wheel_acceleration", "direction")
    source = "RE 25 rotor 10 g cm²; through 1400:1 about 2 kg m² at the wheel"
    requires = ("wheel_acceleration",)
    loads = True
    along_motion = False
    parameter_labels: ClassVar = {"inertia_current": "inertia"}
    coefficients: ClassVar = (Coefficient("inertia_current", "{unit} {per_acceleration}"),)
    shape_keys: ClassVar = {"lag_s": "by which it follows the acceleration"}
    free: ClassVar = {"lag_s": (0.0, float("inf"))}

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Return no lag, and lags of half a reading and of one and a half."""
        return [{"lag_s": readings * problem.recording.step_s} for readings in LAGS]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return dω/dt delayed by the lag, interpolated linearly between readings."""
        late = float(shape.get("lag_s", 0.0)) / problem.recording.step_s
        whole = int(late)
        before = np.pad(problem.covariates["wheel_acceleration"], ((whole + 1, 0), (0, 0)))
        count = len(problem.mask)
        return ((1 - late + whole) * before[1 : count + 1] + (late - whole) * before[:count])[None]

    def bounds(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:  # noqa: ARG002
        """Return lags of a few readings at most."""
        return {"lag_s": (0.0, MOST_READINGS * problem.recording.step_s)}
