"""Water that runs over the edge of a tank."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from regolithd.calibration.mismatch import Candidate, Coefficient, Shape

if TYPE_CHECKING:
    from regolithd.calibration.mismatch import Array, Problem


class Overflow(Candidate):
    """Both tanks lose what rises above their edge; it acts inside the simulation, by its variant `overflow`."""

    name = "overflow"
    covariate = "torque"
    equation = "h_1, h_2 ≤ h_max"
    words = "water that runs over the edge of a full tank"
    signature = "a residual that is negative where the simulated level passes the edge, and for some time after it"
    experiment = "pump until the level stands at the edge, then let it fall"
    source = "Schoukens, Mattsson, Wigren and Noël (2016): description of the benchmark"
    along_motion = False
    coefficients: ClassVar = (Coefficient("overflow", "1"),)
    sharing: ClassVar = ("all",)

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002  # it has no shape
        """Return the level's change when the tanks overflow."""
        return problem.secant("overflow", 1.0)[None]
