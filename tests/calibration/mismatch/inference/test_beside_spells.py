"""A named effect beside what comes and goes keeps its name."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import from_columns

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.answer import Answer

    Array = NDArray[np.float64]

ROWS, STEP_S = 5000, 0.2


class Rake(Simulation):
    """Current of a drive that ploughs a bed, at a few speeds one after the other."""

    channel, unit = "rake_current_A", "A"
    inputs = ("rake_rad_s", "bed_kg")
    parameters: ClassVar = {"per_kg": Prior(0.012, 0.0002, "A/kg")}
    one_way = True
    without_effects = ("grade-resistance", "turning-resistance", "slip-sinkage", "soil-transition", "load-cell-drift")

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current."""
        return values["per_kg"] * inputs["bed_kg"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed."""
        return {"wheel_speed": inputs["rake_rad_s"]}


def raked(quadratic: float, spells: float) -> Answer:
    """Compare 1000 s at eight speeds with a drag of their square, and with one that comes and goes for 8 s or so."""
    rng = np.random.default_rng(11)
    time_s = STEP_S * np.arange(ROWS)
    speed = np.repeat(rng.permutation(np.linspace(0.04, 0.12, 8)), ROWS // 8)
    bed = 500 + 120 * np.sin(time_s / 90) + 60 * np.sin(time_s / 37)
    acting, now = np.zeros(ROWS), 0.0
    for row in range(ROWS):
        now = now if rng.random() > STEP_S / (8.0 if now else 25.0) else 1 - now
        acting[row] = now
    noise = np.convolve(rng.normal(0, 1, ROWS + 3), np.ones(4) / 2, "valid")
    current = 0.012 * bed + quadratic * (speed / 0.1) ** 2 + spells * acting + 0.4 * noise
    columns = {"t_s": time_s, "rake_rad_s": speed, "bed_kg": bed, "rake_current_A": current}
    return compare(from_columns(columns), Rake()).answer


def test_a_drag_is_named_beside_spells() -> None:
    """The speed changes as seldom as the spells come: a curve over time would follow both."""
    found = raked(quadratic=0.8, spells=2.0)
    assert found.verdict == "unexplained"
    assert [place.covariate for place in found.unexplained] == ["time"]
    assert [effect.name for effect in found.effects] == ["quadratic-drag"]


def test_spells_alone_get_no_name() -> None:
    """What follows a law beside them is their noise."""
    found = raked(quadratic=0.0, spells=2.0)
    assert found.verdict == "unexplained"
    assert found.effects == ()
