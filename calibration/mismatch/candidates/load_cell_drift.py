"""One load cell wanders: the simulation is told a load that is not there."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape, onsets, since

if TYPE_CHECKING:
    from collections.abc import Sequence

    from calibration.mismatch.scene import Scene


class LoadCellDrift(Candidate):
    """A reading that creeps away; the current does not follow it.

    Seen twice: in the current, which does not answer to the load that the cell claims, and in the cell itself,
    against what pitch and roll say it should carry.
    """

    name = "load-cell-drift"
    covariate = "time"
    channel = "load_N"
    equation = "W = W_cell − D(t);  ΔI = −(∂I/∂W) D(t)"
    words = "a load cell that wanders"
    signature = "one wheel's load leaves what pitch and roll explain, and its current does not follow"
    experiment = "park on level ground at intervals and compare the six cells' sum with the rover's weight"
    source = "strain-gauge creep and temperature: percents of full scale per hour when faulty"
    requires = ("load",)
    coefficients: ClassVar = (Coefficient("relative_drift", "1", 0),)
    sharing: ClassVar = ("one",)

    def shapes(self, scene: Scene) -> Sequence[Shape]:
        """Ramps and slow approaches from several times on."""
        early: list[Shape] = [
            {"onset_s": -1.0, "rise_s": rise} for rise in (float("inf"), 0.5 * scene.length_s, 0.15 * scene.length_s)
        ]
        later: list[Shape] = [{"onset_s": t, "rise_s": rise} for t in onsets(scene, 12) for rise in (float("inf"), 0.0)]
        return [*early, *later]

    def columns(self, scene: Scene, shape: Shape) -> Array:
        """Return the current that the simulation adds for a reading too large by its own size, taken away again."""
        return (-scene.input_tangent("load_N") * since(scene, float(shape["onset_s"]), float(shape["rise_s"])))[None]
