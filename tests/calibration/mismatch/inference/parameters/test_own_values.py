"""One axis whose own value of a parameter is off: told as that, carried over, and told again when it is repaired."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import compare
from regolithd.calibration.mismatch.corrected import write_corrected
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.simulation.load import load_simulation

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from regolithd.calibration.mismatch.comparison import Comparison

Array = NDArray[np.float64]

STRINGS = ("east", "roof", "west")
STATED = '[simulation]\nmodel = "strings:Strings"\n'
MODULE = """
from regolithd.calibration.mismatch import Prior, Simulation

class Strings(Simulation):
    channel, unit, wheel_column = "power_W", "W", "string"
    inputs = ("sun",)
    parameters = {"peak_W": Prior(5000.0, 80.0, "W"), "idle_W": Prior(40.0, 10.0, "W")}
    own_to_each_wheel = frozenset({"peak_W"})

    def predict(self, inputs, values):
        return values["peak_W"] * inputs["sun"] - values["idle_W"]

    def covariates(self, inputs):
        return {"wind": inputs["wind_m_s"], "time": inputs["t_s"]}
"""


def recorded(seed: int, east: float = 1.0, instants: int = 900) -> Mapping[str, Array]:
    """Return a recording of three strings, of which one gives a share of what the others do."""
    rng = np.random.default_rng(seed)
    sun = np.clip(0.5 + np.cumsum(rng.normal(0, 0.05, (instants, 3)), axis=0) * 0.3, 0.1, 1.0)
    peak = (5000 + rng.normal(0, 80) + rng.normal(0, 27, 3)) * np.array([east, 1.0, 1.0])
    power = peak * sun - 40 + rng.normal(0, 40, sun.shape)
    wind = np.abs(3 + np.cumsum(rng.normal(0, 0.2, instants)))
    return {
        "t_s": np.repeat(np.arange(float(instants)), 3),
        "string": np.tile(STRINGS, instants),
        "power_W": power.ravel(),
        "sun": sun.ravel(),
        "wind_m_s": np.repeat(wind, 3),
    }


@pytest.fixture
def stated(tmp_path: Path) -> Path:
    """Return a SIM.toml with its class beside it."""
    (tmp_path / "strings.py").write_text(MODULE)
    path = tmp_path / "SIM.toml"
    path.write_text(STATED)
    return path


def compared(path: Path, seed: int, east: float = 1.0) -> Comparison:
    """Return the comparison of a recording with the simulation of a file."""
    return compare(recorded(seed, east), load_simulation(path))


def test_what_the_others_have_too_is_consistent(stated: Path) -> None:
    """Deviations as large as the prior says are told by nobody."""
    answer = compared(stated, 1).answer
    assert answer.verdict == "consistent"
    assert [each.name for each in answer.parameters] == ["peak_W", "idle_W"]


def test_one_string_that_gives_less_is_a_finding_of_its_own(stated: Path) -> None:
    """A tenth less on one string is that string's own value, 18 of its standard deviations away."""
    answer = compared(stated, 2, east=0.9).answer
    assert answer.verdict == "missing-physics"
    assert answer.effects == ()
    (own,) = [each for each in answer.parameters if each.name == "peak_W of east"]
    (common,) = [each for each in answer.parameters if each.name == "peak_W"]
    assert own.value == pytest.approx(0.9 * common.value, rel=0.02)
    assert own.prior == pytest.approx(common.value)
    assert own.low < own.value < own.high
    assert abs(common.value - 5000) < 240  # it does not move to the mean of all three


TWO = """

class Two(Strings):
    channels = {"power_W": "W", "grid_W": "W"}

    def predict(self, inputs, values):
        power = Strings.predict(self, inputs, values)
        return {"power_W": power, "grid_W": 0.9 * power}
"""


def test_two_columns_tell_it_once(stated: Path) -> None:
    """Both know the string's own value; the other column does not take it for a parameter of the simulation."""
    stated.with_name("strings.py").write_text(MODULE + TWO)
    stated.write_text(STATED.replace(":Strings", ":Two"))
    table = dict(recorded(2, 0.9))
    table["grid_W"] = 0.9 * table["power_W"] + np.random.default_rng(0).normal(0, 40, len(table["t_s"]))
    answer = compare(table, load_simulation(stated)).answer
    assert [each.name for each in answer.parameters] == ["peak_W", "idle_W", "peak_W of east"]
    assert answer.verdict == "missing-physics"


def test_a_season_of_recordings_tells_it_and_carries_it_over(stated: Path) -> None:
    """More than half of a rover's recordings show it by themselves: it is released in all of them together."""
    corrected = stated.with_name("NEW.toml")
    found = compare([recorded(seed, 0.9) for seed in (2, 4, 6)], load_simulation(stated))
    assert found.answer.verdict == "missing-physics"
    (own,) = [each for each in found.answer.parameters if each.name == "peak_W of east"]
    (common,) = [each for each in found.answer.parameters if each.name == "peak_W"]
    assert own.value == pytest.approx(0.9 * common.value, rel=0.03)
    found.write_corrected(corrected)
    assert compare(recorded(8, 0.9), load_simulation(corrected)).answer.verdict == "consistent"
    again = compare([recorded(seed, 0.9) for seed in (2, 4, 6)], load_simulation(corrected)).answer
    assert again.verdict == "consistent"
    assert again.parameters[0].value == pytest.approx(common.value, abs=5)  # the stated deviation holds in a season


def test_a_corrected_simulation_has_it_and_tells_when_it_is_gone(stated: Path) -> None:
    """The same string later is consistent; the string repaired has its own value again."""
    found, corrected = compared(stated, 2, east=0.9), stated.with_name("NEW.toml")
    write_corrected(corrected, found.answer, found.evidence, found.simulation)
    assert compare(recorded(2, 0.9), load_simulation(corrected)).answer.verdict == "consistent"
    gone = compare(recorded(2), load_simulation(corrected)).answer
    assert gone.verdict == "missing-physics"
    (own,) = [each for each in gone.parameters if each.name == "peak_W of east"]
    assert own.value > own.prior + 400
    again = stated.with_name("AGAIN.toml")
    kept = compare(recorded(2, 0.9), load_simulation(corrected))
    write_corrected(again, kept.answer, kept.evidence, kept.simulation)
    assert dict(load_simulation(again).parameters["peak_W"].own)["east"] == pytest.approx(-500, abs=100)


@pytest.mark.parametrize(
    ("own", "told"),
    [
        ("own = 3", r"\[parameters\.peak_W\.own\] has a deviation for each wheel"),
        ('own = {east = "x"}', r"\[parameters\.peak_W\.own\] east: a finite number is needed"),
    ],
)
def test_what_is_no_table_of_deviations_is_one_message(stated: Path, own: str, told: str) -> None:
    """A wrong deviation is told with its file, line and key."""
    stated.write_text(f"{STATED}[parameters.peak_W]\n{own}\n")
    with pytest.raises(SimulationError, match=rf"SIM\.toml, line \d+: {told}"):
        load_simulation(stated)


def test_deviations_of_a_parameter_that_all_share_are_refused(stated: Path) -> None:
    """Only a parameter that is own to each wheel has deviations."""
    stated.write_text(f"{STATED}[parameters.idle_W]\nown = {{east = 3.0}}\n")
    with pytest.raises(SimulationError, match="idle_W has deviations of single wheels"):
        load_simulation(stated)


def test_a_stated_deviation_of_a_wheel_that_is_not_there_is_a_note(stated: Path) -> None:
    """A misspelt wheel would otherwise be without its deviation silently."""
    stated.write_text(f"{STATED}[parameters.peak_W]\nown = {{eest = -30.0}}\n")
    notes = compared(stated, 1).answer.notes
    assert "peak_W has a deviation of eest, which the recording does not have." in notes
