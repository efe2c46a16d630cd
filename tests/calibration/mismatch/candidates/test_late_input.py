"""A late input: once its delay is named, all else is looked for with that input on time."""

from __future__ import annotations

import inspect
from dataclasses import replace
from functools import partial
from hashlib import sha256
from typing import TYPE_CHECKING

import fleet_arm
import numpy as np
import pytest
import tram
from tram import COUNT, DELAY_S, Array, Tram, driven

from regolithd.calibration.mismatch import Member, compare, load_simulation, read_recording
from regolithd.calibration.mismatch.calibration.linearised import put_on_time_by
from regolithd.calibration.mismatch.candidates.sensor_delay import SensorDelay
from regolithd.calibration.mismatch.fleet.comparison import compare_fleet
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.problem import StatedEffect

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


def test_what_else_acts_is_found_beside_a_late_input() -> None:
    """Drag of a tenth of what the delay changes has its name and size, and no parameter takes it up."""
    found = compare(driven(1, drag=0.1), Tram()).answer
    effects = {effect.name: effect.parameters for effect in found.effects}
    assert effects.keys() == {"sensor-delay", "quadratic-drag"}
    delay, drag = effects["sensor-delay"]["delay_s"], effects["quadratic-drag"]["quadratic_coefficient"]
    assert delay.low < DELAY_S < delay.high
    assert delay.value == pytest.approx(DELAY_S, abs=0.3)
    assert drag.low < 0.1 < drag.high
    assert found.unexplained == ()
    assert all(each.prior_stds_away < 2.5 for each in found.parameters)


def test_a_delay_changes_as_much_with_the_input_on_time_as_without() -> None:
    """The residual is that of the simulation as it is; the columns and covariates are those of the input on time."""
    recording, delay = driven(2), SensorDelay()
    late = {"grade": DELAY_S}
    before, problem = build_problem(recording, Tram()), build_problem(recording, Tram(), late=late)
    np.testing.assert_allclose(problem.residual[problem.mask], before.residual[problem.mask])
    assert np.flatnonzero(~problem.mask[:, 0]).tolist() == list(range(COUNT - 7, COUNT)), "what follows is not recorded"
    within = slice(20, COUNT - 20)  # the ends are held
    shape = {"late": "grade", "input_secant_s": 5.0}
    np.testing.assert_allclose(
        delay.columns(problem, shape)[0, within], delay.columns(before, shape)[0, within], atol=2e-3
    )
    exact = {"late": "grade", "input_secant_s": DELAY_S}
    (column,) = delay.columns(problem, exact)
    np.testing.assert_allclose(column, (problem.filled - before.filled) / DELAY_S)
    assert exact in delay.shapes(problem)
    on_time = driven(2, delay_s=0.0).channels["grade"]
    np.testing.assert_allclose(problem.covariates["pitch"][within], on_time[within], atol=1e-9)
    speed = recording.channels["speed_m_s"]
    tangent = problem.values["weight"] * speed[within]
    np.testing.assert_allclose(problem.tangent("rolling")[within], tangent, rtol=1e-6)


@pytest.mark.parametrize("delay_s", [40.0, 100.0])
def test_a_delay_may_be_longer_than_its_input_takes_to_change(delay_s: float) -> None:
    """It is found among delays of all whole readings, to the reading; the drag beside it has its name."""
    for seed, drag in ((20, 0.0), (23, 0.05)):
        found = compare(driven(seed, delay_s, drag), Tram()).answer
        assert {effect.name for effect in found.effects} == {"sensor-delay", *(["quadratic-drag"] if drag else [])}
        delay = next(effect for effect in found.effects if effect.name == "sensor-delay").parameters["delay_s"]
        assert delay.low < delay_s < delay.high
        assert delay.high - delay.low < 1.0
        assert delay.value == pytest.approx(delay_s, abs=0.1)
        assert found.unexplained == ()


class Downhill(Tram):
    """A tram whose simulation says nothing downhill, where its brakes work."""

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current uphill."""
        return np.where(inputs["grade"] > 0, super().predict(inputs, values), np.nan)


def test_where_the_input_on_time_has_no_prediction_the_delay_changes_nothing() -> None:
    """What a prediction of nothing would change is not taken for the delay's: it is found all the same."""
    recording = driven(2)
    problem = build_problem(recording, Downhill())
    (column,) = SensorDelay().columns(problem, {"late": "grade", "input_secant_s": DELAY_S})
    on_time = np.roll(recording.channels["grade"][:, 0], -int(DELAY_S))
    unknown = problem.mask[:, 0] & (on_time <= 0)
    assert unknown.any()
    np.testing.assert_array_equal(column[unknown, 0], 0.0)
    (effect,) = compare(recording, Downhill()).answer.effects
    assert effect.name == "sensor-delay"
    assert effect.parameters["delay_s"].low < DELAY_S < effect.parameters["delay_s"].high


def test_each_of_two_late_inputs_has_its_own_change() -> None:
    """With both on time, of the first it is that of it alone; together they are what both of them change."""
    recording, delay = driven(2), SensorDelay()
    late = {"grade": DELAY_S, "speed_m_s": 20.0}
    before = build_problem(recording, Tram())
    both = build_problem(recording, Tram(), late=late)
    shapes = [{"late": name, "input_secant_s": late_by} for name, late_by in late.items()]
    changes = [late_by * delay.columns(both, shape)[0] for shape, late_by in zip(shapes, late.values(), strict=True)]
    within = slice(30, COUNT - 30)  # the ends are held
    np.testing.assert_allclose(sum(changes)[within], (both.filled - before.filled)[within], atol=1e-9)
    speed_on_time = both.recording.channels["speed_m_s"]
    of_grade = (
        both.values["weight"] * speed_on_time * (both.recording.channels["grade"] - before.recording.channels["grade"])
    )
    np.testing.assert_allclose(changes[0][within], of_grade[within], atol=1e-9)


def test_inputs_on_time_of_which_none_is_named_late_are_searched_again() -> None:
    """What is on time has to be told as late, but for what the simulation was corrected by."""
    problem = build_problem(driven(2), Tram(), late={"grade": DELAY_S, "speed_m_s": 20.0})
    assert put_on_time_by(problem, {"grade": DELAY_S, "speed_m_s": 20.0}, None)
    assert not put_on_time_by(problem, {"grade": DELAY_S}, None)
    stated = StatedEffect("sensor-delay", problem.recording.wheels, np.zeros(problem.mask.shape), 0.1, on_time=True)
    assert put_on_time_by(replace(problem, stated=(stated,)), {"grade": DELAY_S}, None)


def test_the_change_is_interpolated_between_delays_of_whole_readings() -> None:
    """Exact where the prediction is linear in the input, at two runs for all delays between."""
    problem, delay = build_problem(driven(2), Tram()), SensorDelay()

    def change(delay_s: float) -> Array:
        return delay_s * delay.columns(problem, {"late": "grade", "input_secant_s": delay_s})[0]

    np.testing.assert_allclose(change(6.25), 0.75 * change(6.0) + 0.25 * change(7.0))
    assert [name for name, _ in problem.made if name == "grade late"] == ["grade late"] * 2


def test_a_corrected_delay_puts_the_input_of_a_later_recording_on_time(tmp_path: Path) -> None:
    """The same is consistent, and drag that is new has its name and size."""
    (tmp_path / "tram.py").write_text(inspect.getsource(tram))
    (tmp_path / "SIM.toml").write_text('[simulation]\nmodel = "tram:Tram"\n')
    first = compare(driven(3), load_simulation(tmp_path / "SIM.toml"))
    assert [effect.name for effect in first.answer.effects] == ["sensor-delay"]
    first.write_corrected(tmp_path / "NEW.toml")
    corrected = load_simulation(tmp_path / "NEW.toml")
    assert compare(driven(4), corrected).answer.verdict == "consistent"
    new = compare(driven(5, drag=0.05), corrected).answer
    assert [effect.name for effect in new.effects] == ["quadratic-drag"]
    assert new.changes == ()
    late = compare(driven(6, delay_s=12.0), corrected).answer
    (change,) = late.changes
    assert (change.name, change.parameter) == ("sensor-delay", "delay_s")
    assert change.low < 12.0 < change.high


def test_a_fleet_is_compared_with_late_inputs_on_time(tmp_path: Path) -> None:
    """Delay and drag have their names and sizes, and no parameter takes up what they leave."""
    (tmp_path / "tram.py").write_text(inspect.getsource(tram))
    (tmp_path / "SIM.toml").write_text('[simulation]\nmodel = "tram:Tram"\n')
    members = []
    for seed, rover in enumerate(("A", "B", "C"), start=11):
        path = fleet_arm.write_recording(tmp_path / f"{rover}.csv", tram.columns(seed, drag=0.1))
        digest = sha256(path.read_bytes()).hexdigest()
        members.append(Member(path.name, rover, None, partial(read_recording, path), digest))
    found = compare_fleet(members, partial(load_simulation, tmp_path / "SIM.toml")).answer
    assert {effect.name for effect in found.effects} == {"sensor-delay", "quadratic-drag"}
    for effect in found.effects:
        name, true = {"sensor-delay": ("delay_s", DELAY_S)}.get(effect.name, ("quadratic_coefficient", 0.1))
        assert effect.parameters[name].low < true < effect.parameters[name].high
    assert found.unexplained == ()
    assert all(abs(each.value - each.prior) < 2.5 * each.prior_std for each in found.parameters)
