"""Names that have more evidence than the answer, and pass every test that it passed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import fleet_arm
import numpy as np
import pytest
from winch import Winch

from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.inference.other_answers import likelier_names
from regolithd.calibration.mismatch.inference.other_answers.alternatives import Alternative
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch import Candidate

    Array = NDArray[np.float64]

ROWS, STEP_S, ONSET_S = 4000, 0.25, 500.0


class InTheWind(Winch):
    """A winch on which a wind acts."""

    inputs = ("pull_N", "speed", "wind_m_s")

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed, time and wind."""
        return {**super().covariates(inputs), "wind": inputs["wind_m_s"]}


def smooth(rng: np.random.Generator, period_s: float) -> Array:
    """Return a course of three sines about a period, with a standard deviation of 1."""
    time_s = STEP_S * np.arange(ROWS)
    course = sum(np.sin(2 * np.pi * time_s / (period_s * k) + rng.uniform(0, 6)) for k in (0.6, 1.0, 1.7))
    return np.asarray(course / np.std(course))


class WarmArm(fleet_arm.Arm):
    """The arm, with the whole library and a temperature."""

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return what a drag may follow."""
        return {**super().covariates(inputs), "temperature": inputs["gear_temperature_degC"]}

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:
        """Return all."""
        return library


def test_one_curve_that_several_names_imitate_takes_their_place() -> None:
    """A drag about 5 °C, where the gear is for the last third: a drag on each joint that begins is nearly the same."""
    table = fleet_arm.columns(4)
    temperature = -20.0 + 30.0 * (1 - np.exp(-table["t_s"] / 12))
    drag = 0.25 * np.sign(table["speed_rad_s"]) * np.exp(-0.5 * ((temperature - 5.0) / 6.0) ** 2)
    columns = {**table, "gear_temperature_degC": temperature, "torque_Nm": table["torque_Nm"] + drag}
    answer = compare(columns, WarmArm()).answer
    assert answer.effects == ()
    assert [place.covariate for place in answer.unexplained] == ["temperature"]


def test_a_drag_that_begins_is_named_beside_a_curve_that_was_found_before_it() -> None:
    """The noise is estimated with the curve out of it at last, and beside that the drag has its evidence."""
    rng = np.random.default_rng(4)
    time_s, speed, wind = STEP_S * np.arange(ROWS), smooth(rng, 20.0), 8 + 2.5 * smooth(rng, 150.0)
    noise = np.zeros(ROWS)
    for row in range(1, ROWS):
        noise[row] = 0.6 * noise[row - 1] + rng.normal(0, 0.08)
    pull = 40 + 10 * smooth(rng, 45.0)
    drag = 0.12 * np.sign(speed) * (time_s >= ONSET_S)
    current = 0.02 * pull + 0.18 * np.sin(2 * np.pi * wind / 8.3) + drag + noise
    columns = {"t_s": time_s, "current_A": current, "speed": speed, "pull_N": pull, "wind_m_s": wind}
    answer = compare(from_columns(columns, unit="drum"), InTheWind()).answer
    assert [effect.name for effect in answer.effects] == ["bearing-drag"]
    assert abs((answer.effects[0].onset_s or 0.0) - ONSET_S) < 0.1 * time_s[-1]
    assert [place.covariate for place in answer.unexplained] == ["wind"]


@pytest.mark.parametrize(
    ("names", "other", "margin", "is_taken"),
    [
        (("drag",), (), -0.1, True),
        (("drag",), (), 0.1, False),
        (("drag",), ("ripple",), -0.1, True),
        (("drag", "ripple"), ("drag",), -0.9 * THRESHOLDS.lead_margin, False),
        (("drag", "ripple"), ("drag",), -1.1 * THRESHOLDS.lead_margin, True),
    ],
)
def test_an_answer_takes_the_place_of_names_where_it_is_likelier(
    monkeypatch: pytest.MonkeyPatch, names: tuple[str, ...], other: tuple[str, ...], margin: float, is_taken: bool
) -> None:
    """Nothing, or other names, where they are ahead at all; fewer names by more than chance."""
    terms = [SimpleNamespace(name=name, group=SimpleNamespace(named=True)) for name in names]
    decision: Any = SimpleNamespace(
        equations=SimpleNamespace(thresholds=THRESHOLDS), whole=SimpleNamespace(terms=terms)
    )
    taken = object()
    monkeypatch.setattr(likelier_names, "alternatives", lambda _: (Alternative(other, margin),))
    monkeypatch.setattr(likelier_names, "_named", lambda *_: taken)
    assert (likelier_names.likelier_names(decision) is taken) == is_taken
