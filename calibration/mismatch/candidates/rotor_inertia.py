"""Current that accelerates rotor, gears and wheel."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape

if TYPE_CHECKING:
    from calibration.mismatch.scene import Scene


class RotorInertia(Candidate):
    """Inertia as seen at the wheel: the rotor's times the gear ratio squared dominates."""

    name = "rotor-inertia"
    covariate = "wheel_acceleration"
    equation = "ΔI = (J/k) dω/dt"
    words = "current that goes into accelerating rotor and wheel"
    signature = "short residuals at each change of speed, with the acceleration's sign"
    experiment = "start, stop and reverse sharply, many times, on level ground"
    source = "RE 25 rotor 10 g cm²; through 1400:1 about 2 kg m² at the wheel"
    requires = ("wheel_acceleration",)
    coefficients: ClassVar = (Coefficient("inertia_current", "{unit} s²/rad"),)

    def columns(self, scene: Scene, shape: Shape) -> Array:  # noqa: ARG002
        """Return dω/dt."""
        return np.asarray(scene.covariates["wheel_acceleration"])[None]
