"""Which covariate something unexplained depends on, where two of them go together."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior, Simulation, compare, from_columns
from regolithd.calibration.mismatch.inference.other_answers.other_covariates import notes_on_a_curve_in_place
from regolithd.calibration.mismatch.selection.decision import UNEXPLAINED
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

INSTANTS = 1500


class Pump(Simulation):
    """A pump whose power follows its flow; the pressure behind it is recorded too."""

    channel, unit = "power_W", "W"
    inputs = ("flow_l_s", "pressure_kPa")
    parameters: ClassVar = {"power_of_flow": Prior(20.0, 1.0, "W s/l")}

    def predict(self, inputs: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return power in proportion to flow."""
        return values["power_of_flow"] * inputs["flow_l_s"]

    def covariates(self, inputs: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        """Return flow and pressure."""
        return {"flow": inputs["flow_l_s"], "pressure": inputs["pressure_kPa"]}


def notes(throttled: float) -> tuple[str, ...]:
    """Compare with a pump of which more power is taken at one flow; a valve behind it moves by so much."""
    rng = np.random.default_rng(3)
    t_s = np.arange(INSTANTS) * 0.5
    flow = 3.0 + 2.0 * np.sin(t_s / 17) * np.cos(t_s / 41)
    pressure = 4.0 * flow**2 * (1.0 + throttled * np.sin(t_s / 23)) + rng.normal(0, 0.05, INSTANTS)
    power = 20.0 * flow + 8.0 * np.exp(-(((flow - 3.5) / 0.5) ** 2)) + rng.normal(0, 1.5, INSTANTS)
    found = compare(from_columns({"t_s": t_s, "flow_l_s": flow, "pressure_kPa": pressure, "power_W": power}), Pump())
    assert found.answer.verdict == "unexplained"
    assert {each.covariate for each in found.answer.unexplained} <= {"flow", "pressure"}
    return tuple(note for note in found.answer.notes if "go together" in note)


@pytest.mark.parametrize(("throttled", "told"), [(0.0, 1), (0.6, 0)])
def test_covariates_that_go_together_are_both_told(throttled: float, told: int) -> None:
    """With the valve fixed the pressure follows the flow; with a moving one the flow alone explains the power."""
    found = notes(throttled)
    assert len(found) == told
    assert all("flow" in note and "pressure" in note for note in found)


@pytest.mark.parametrize(("period_s", "seed"), [(900.0, 0), (1500.0, 1)])
def test_what_follows_a_covariate_that_changes_slowly_is_told_over_that(period_s: float, seed: int) -> None:
    """A curve over time has knots enough to explain more of a bump over the pressure, and no law: a note tells it."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(2 * INSTANTS) * 0.5
    pressure = 40.0 + 25.0 * np.sin(2 * np.pi * t_s / period_s + seed)
    flow = 3.0 + 2.0 * np.sin(t_s / 7) * np.cos(t_s / 11)
    bump = 12.0 * np.exp(-0.5 * ((pressure - 45.0) / 6.0) ** 2)
    power = 20.0 * flow + bump + rng.normal(0, 3.0, len(t_s))
    found = compare(from_columns({"t_s": t_s, "flow_l_s": flow, "pressure_kPa": pressure, "power_W": power}), Pump())
    assert [each.covariate for each in found.answer.unexplained] == ["pressure"]
    assert any("over the pressure follows time nearly as well" in note for note in found.answer.notes)


class Stirrer(Simulation):
    """A motor whose current follows the load; the speed of a second one is recorded too."""

    channel, unit = "current_A", "A"
    inputs = ("load_N", "stirrer_rpm")
    parameters: ClassVar = {"A_per_N": Prior(0.05, 0.002, "A/N")}

    def predict(self, inputs: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return current in proportion to the load."""
        return values["A_per_N"] * inputs["load_N"]

    def covariates(self, inputs: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        """Return the second motor's speed."""
        return {"stirrer": inputs["stirrer_rpm"]}


@pytest.mark.parametrize(("varied", "told"), [(0.0, True), (0.4, False)])
def test_a_curve_says_where_it_may_be_a_share_or_an_offset(varied: float, told: bool) -> None:
    """At one load these are the same; where the load varies at the same speed, the recording tells."""
    rng = np.random.default_rng(2)
    t_s = np.arange(2 * INSTANTS) * 0.5
    load = 100.0 * (1.0 + varied * np.sin(t_s / 13))
    rpm = 20.0 + 10.0 * np.sin(t_s / 41)
    current = 0.05 * load + 1.0 * np.exp(-0.5 * ((rpm - 18.0) / 3.0) ** 2) + rng.normal(0, 0.15, len(t_s))
    columns = {"t_s": t_s, "current_A": current, "load_N": load, "stirrer_rpm": rpm}
    found = compare(from_columns(columns), Stirrer()).answer
    assert [each.covariate for each in found.unexplained] == ["stirrer"]
    about = [note for note in found.notes if note.startswith("Whether what is unexplained over the stirrer is ")]
    assert bool(about) is told
    assert all("a share of the prediction" in note and "an offset" in note for note in about)


ONE_OF_TWO = (
    "temperature and load go together in this recording. One has to vary without the other to tell which it depends on."
)
FURTHER = "the load has to vary further to tell."


@pytest.mark.parametrize(
    ("over", "knots", "what", "why"),
    [
        ("temperature", 8, "something without a name that follows the load", ONE_OF_TWO),
        ("none", 8, "something without a name that follows the load", FURTHER),
        ("temperature", 1, "a constant share of the prediction, without a name", FURTHER),
    ],
)
def test_a_curve_that_is_as_probable_as_the_only_name_is_told_beside_it(
    over: str, knots: int, what: str, why: str
) -> None:
    """Over another covariate, beside a constant, which has none, and as a constant share."""
    group = SimpleNamespace(named=False, region=None, columns=(0,) * knots, coupling="gain")
    curve: Any = SimpleNamespace(name="load", group=group)
    decision: Any = SimpleNamespace(
        equations=SimpleNamespace(problem=SimpleNamespace(labels={}), thresholds=THRESHOLDS),
        named=SimpleNamespace(terms=[SimpleNamespace(name="bearing-drag", imitated_over=over)]),
    )
    other: Any = SimpleNamespace(effects=(UNEXPLAINED,), terms=(curve,), margin=1.0)
    assert notes_on_a_curve_in_place(decision, [other]) == (f"bearing-drag is about as probable as {what}: {why}",)
