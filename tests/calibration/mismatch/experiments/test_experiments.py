"""The choice of an experiment: what can be set, drives as predicted, margins, and the drive that is chosen."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
import rover_drives
from linear_machine import AXES, NOISE, STEP_S, Drag, Level, Power, equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch import direction_of, from_columns
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.experiments.choice import experimenter_of
from regolithd.calibration.mismatch.experiments.drives import DIRECTION, SPEED, UNLOADED, Drives
from regolithd.calibration.mismatch.experiments.margins import (
    expected_of,
    of_both,
    of_effect,
    of_parameter,
    precisions,
    predictable,
)
from regolithd.calibration.mismatch.experiments.settings import Setting, predicts_row_by_row, settings_of
from regolithd.calibration.mismatch.inference.other_answers.experiment import range_in_words, with_experiment
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.regression.equations import smooth_equations, with_library
from regolithd.calibration.mismatch.regression.group import Term

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
THRESHOLD = 8.0


class Warm(Level):
    """The machine with a gear between the recorded speed and the wheel's, and a temperature that never varies."""

    inputs = ("speed_rad_s", "motor_degC")
    experiment_spans: ClassVar = {"temperature": 10.0}
    unloaded_experiment = "take the load off"

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the wheel's speed, the temperature, and a heat that two columns make."""
        speed = (inputs["speed_rad_s"] - 0.1) / 4
        heat = inputs["motor_degC"] * inputs["speed_rad_s"] ** 2
        return {"wheel_speed": speed, "temperature": inputs["motor_degC"], "heat": heat, "time": inputs["t_s"]}


class Lagging(Level):
    """A machine with a state: the level follows the speed's running sum."""

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the level and a hundredth of the way."""
        return values["level"] + 0.01 * np.cumsum(inputs["speed_rad_s"], axis=0)


class Careful(Level):
    """A machine whose user refuses speeds that were not recorded."""

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the level at the recorded speed alone."""
        if np.any(np.abs(inputs["speed_rad_s"]) != 2.1):
            raise SimulationError("2.1 rad/s alone")
        return super().predict(inputs, values)


class Choosy(Level):
    """A machine whose covariates are those of the recorded speed alone."""

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed, if it is the recorded one."""
        Careful().predict(inputs, {"level": 0.0})
        return super().covariates(inputs)


def one_way(drag: float = 0.3) -> dict[str, Array]:
    """Return a recording at one speed in one direction."""
    columns = table(drag=drag)
    noise = columns["reading_V"] - 2.0 - drag * np.sign(columns["speed_rad_s"])
    return {
        **columns,
        "speed_rad_s": np.full(len(noise), 2.1),
        "motor_degC": np.full(len(noise), 20.0),
        "reading_V": 2.0 + drag + noise,
    }


def warm(drag: float = 0.3) -> NormalEquations:
    """Return the equations of such a recording."""
    return equations_of(build_problem(from_columns(one_way(drag), unit="axis"), Warm()), (Drag(), Power()))


def test_a_column_sets_a_covariate_that_is_linear_in_it() -> None:
    """The speed through the gear, from half to one and a half times the usual; the temperature as far as is stated."""
    found = settings_of(warm().problem, ["wheel_speed", "temperature", "heat", "time", "slip"])
    assert list(found) == ["wheel_speed", "temperature"]
    speed, temperature = found["wheel_speed"], found["temperature"]
    assert (speed.channel, speed.low, speed.high) == ("speed_rad_s", pytest.approx(0.25), pytest.approx(0.75))
    assert speed.channel_at(np.array([[0.5]])) == pytest.approx(np.full((1, AXES), 2.1))
    assert (temperature.low, temperature.high) == (10.0, 30.0)


def test_a_speed_is_not_varied_from_standstill() -> None:
    """A machine that rests for a third of the time has a slowest motion, and 0 is none."""
    columns = table()
    columns["speed_rad_s"] = np.where(np.arange(len(columns["t_s"])) % 3 == 0, 0.0, columns["speed_rad_s"])
    problem = problem_of(columns)
    moving = np.abs(problem.covariates["wheel_speed"][problem.covariates["wheel_speed"] != 0])
    setting = settings_of(problem, ["wheel_speed"])["wheel_speed"]
    assert 0 < setting.low <= np.quantile(moving, 0.02)


def test_a_covariate_that_nothing_says_how_to_vary_is_not_set() -> None:
    """A constant one without a span."""

    class Cold(Warm):
        experiment_spans: ClassVar = {}

    problem = build_problem(from_columns(one_way(), unit="axis"), Cold())
    assert list(settings_of(problem, ["wheel_speed", "temperature"])) == ["wheel_speed"]


def test_a_simulation_with_a_state_is_not_predicted() -> None:
    """Rows that are put together otherwise would be another history."""
    assert predicts_row_by_row(problem_of(table()))
    problem = build_problem(from_columns(table(), unit="axis"), Lagging())
    assert not predicts_row_by_row(problem)
    experimenter = experimenter_of(equations_of(problem, (Drag(),)), THRESHOLD)
    assert experimenter.drives is None
    assert experimenter.unpredictable == (
        "a prediction depends on other rows too: the simulation has a state or a rate of change"
    )


def test_a_direction_of_a_noisy_speed_is_no_state() -> None:
    """`direction_of` estimates the noise at standstill from the rows that it is given: few of them differ."""

    class Rolling(Warm):
        def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
            return values["level"] + 0.5 * direction_of(inputs["speed_rad_s"])

    columns = table()
    noise = np.random.default_rng(3).normal(0, 0.002, columns["speed_rad_s"].shape)
    columns = {**columns, "speed_rad_s": columns["speed_rad_s"] + noise, "motor_degC": 20 + 0 * noise}
    assert predicts_row_by_row(build_problem(from_columns(columns, unit="axis"), Rolling()))


def test_a_simulation_that_refuses_a_drive_has_no_predicted_experiment() -> None:
    """Whether its prediction does or its covariates do; the comparison goes on."""
    recording = from_columns(one_way(), unit="axis")
    refused = equations_of(build_problem(recording, Careful()), (Drag(), Power()))
    hypotheses = [of_effect(refused, (), term_of(refused, name)) for name in ("drag", "power")]
    assert experimenter_of(refused, THRESHOLD).choose(hypotheses, ()) is None
    choosy = equations_of(build_problem(recording, Choosy()), (Drag(), Power()))
    told = "the simulation accepts no other inputs than those recorded"
    assert experimenter_of(choosy, THRESHOLD).unpredictable == told


def test_every_law_of_the_library_that_follows_from_a_drive_is_predicted() -> None:
    """On a drive of the rover that varies everything it is finite, and other than zero."""
    problem = build_problem(from_columns(rover_drives.columns(3, length_s=60.0)), rover_drives.simulation())
    equations, _ = with_library(smooth_equations(problem), library())
    experimenter = experimenter_of(equations, THRESHOLD)
    assert experimenter.drives is not None
    assert {"wheel_speed", "temperature", "pitch", "slip", "torque"} <= set(experimenter.drives.settings)
    terms = {group.name: Term(group, tuple(range(6))) for group in equations.design.groups if group.named}
    hypotheses = [of_effect(equations, (), term) for term in terms.values() if predictable(term)]
    names = {one.name for one in hypotheses}
    assert {"coulomb-friction", "load-dependent-efficiency", "slip-sinkage", "grade-resistance"} <= names
    assert not {"bearing-drag", "soil-transition", "load-cell-drift", "sensor-delay", "multi-pass-compaction"} & names
    expected = expected_of(
        experimenter.drives(frozenset(experimenter.drives.elements)),
        hypotheses,
        (),
        precision=precisions(equations),
        information_per_s=experimenter.information_per_s,
    )
    assert np.isfinite(expected.gram).all()
    assert (np.diag(expected.gram)[list(expected.predicted)] > 0).all()


def test_a_drive_varies_what_is_asked_for_and_nothing_else() -> None:
    """Speed and temperature step through their ranges, the direction changes, and the last third is without load."""
    drives = Drives(warm().problem, ["wheel_speed", "temperature"])
    assert drives.elements == ("wheel_speed", "temperature", "direction", "wheel_acceleration", "unloaded")
    speeds = drives(frozenset({SPEED})).problem.covariates
    levels = np.unique(np.abs(speeds["wheel_speed"]).round(6)).tolist()
    assert levels == pytest.approx([0.25, 0.416667, 0.583333, 0.75])
    assert speeds["wheel_speed"].min() < 0, "what is varied of the motion is varied both ways"
    assert np.unique(speeds["temperature"]).tolist() == [20.0]
    assert not speeds["wheel_acceleration"].any()
    both = drives(frozenset({DIRECTION})).problem.covariates
    assert np.unique(both["wheel_speed"].round(6)).tolist() == [-0.5, 0.5]
    lifted = drives(frozenset({UNLOADED}))
    assert lifted.loaded.mean() == pytest.approx(2 / 3)
    assert not lifted.problem.prediction[lifted.loaded[:, 0] == 0].any()
    assert not lifted.tangents[:, lifted.loaded[:, 0] == 0].any()
    assert drives(frozenset({SPEED})) is drives(frozenset({SPEED}))


def test_the_margin_is_the_energy_that_the_other_law_leaves() -> None:
    """Of a drag that reverses beside a level: all of it, in proportion to the readings and one over the variance."""
    equations = equations_of(problem_of(table(drag=0.3)), (Drag(), Power()))
    experimenter = experimenter_of(equations, THRESHOLD)
    assert experimenter.drives is not None
    drag, power = (of_effect(equations, (), term_of(equations, name)) for name in ("drag", "power"))
    assert drag.coefficients[0] == pytest.approx(0.3, rel=0.1)
    expected = expected_of(
        experimenter.drives(frozenset({DIRECTION})),
        (drag, power),
        (),
        precision=np.array([0.0]),
        information_per_s=experimenter.information_per_s,
    )
    # At one speed the power of it is the level: nothing is left of it, and half the pair's margin is the drag's.
    whole = AXES * 100.0 / STEP_S * drag.coefficients[0] ** 2 / NOISE**2
    assert expected.margins(100.0)["drag", "power"] == pytest.approx(whole / 2, rel=0.05)
    assert expected.margins(200.0)["drag", "power"] == pytest.approx(whole, rel=0.05)


def test_of_a_law_with_and_without_another_the_margin_is_what_the_other_adds() -> None:
    """It is not halved as between two laws: alone, the first explains no more than both."""
    equations = equations_of(problem_of(table(drag=0.3, factor=0.2)), (Drag(), Power()))
    experimenter = experimenter_of(equations, THRESHOLD)
    assert experimenter.drives is not None
    drag, power = term_of(equations, "drag"), term_of(equations, "power")
    alone, both = of_effect(equations, (), power), of_both(equations, (power,), power, drag)
    assert (both.name, both.adds_to(alone), alone.adds_to(both)) == ("power with drag", True, False)
    assert (both.coefficients[0], both.more_coefficients[0]) == pytest.approx((0.2, 0.3), rel=0.1)
    drive = experimenter.drives(frozenset({DIRECTION}))
    information = experimenter.information_per_s
    for answers in ((alone, both), (both, alone)):
        expected = expected_of(drive, answers, (), precision=np.array([0.0]), information_per_s=information)
        ((_, margin),) = expected.margins(100.0).items()
        whole = AXES * 100.0 / STEP_S * both.more_coefficients[0] ** 2 / NOISE**2
        assert margin == pytest.approx(whole, rel=0.05)


def test_the_sizes_are_the_recordings_or_the_smallest_worth_an_experiment() -> None:
    """Of an effect that is not there, and of a parameter that has its stated value."""
    equations = equations_of(problem_of(table(drag=0.0)), (Drag(), Power()))
    least = 0.05 * equations.problem.mean_size
    assert abs(of_effect(equations, (), term_of(equations, "drag")).coefficients[0]) == pytest.approx(least, rel=0.05)
    level = of_parameter(equations, (), "level-error")
    assert level is not None
    assert abs(level.shift) == pytest.approx(least, rel=0.05)
    assert of_parameter(equations, (), "drag") is None


def test_what_depends_on_time_follows_from_no_drive() -> None:
    """A change point, or another channel's fault."""
    term = term_of(warm(), "drag")
    assert predictable(term)
    assert not predictable(replace(term, group=replace(term.group, shape={"onset_s": 3.0})))
    assert not predictable(replace(term, group=replace(term.group, candidate=None)))


def test_the_chosen_drive_is_the_least_that_tells_the_closest_two_apart() -> None:
    """A drag and a power of the speed at one speed: other speeds do, both ways adds little, the temperature nothing."""
    equations = warm()
    experimenter = experimenter_of(equations, THRESHOLD)
    hypotheses = [of_effect(equations, (), term_of(equations, name)) for name in ("drag", "power")]
    choice = experimenter.choose(hypotheses, ())
    assert choice is not None
    assert "temperature" not in choice.varied
    assert set(choice.pair) == {"drag", "power"}
    assert choice.margin >= choice.needed
    assert experimenter.choose(hypotheses[:1], ()) is None
    quiet = replace(experimenter, information_per_s=experimenter.information_per_s * 1e-9)
    assert quiet.choose(hypotheses, ()) is None, "no drive tells them apart"


def test_a_machine_that_runs_one_way_is_never_asked_to_reverse() -> None:
    """Its drives keep the direction, instructions ask for speeds in its place, and programs are told the same."""

    class Pump(Warm):
        one_way, unloaded_experiment = True, ""
        covariate_labels: ClassVar = {"wheel_speed": "pump speed (rad/s)"}

    problem = build_problem(from_columns(one_way(), unit="axis"), Pump())
    drives = Drives(problem, ["wheel_speed", "temperature"])
    assert drives.elements == ("wheel_speed", "temperature", "wheel_acceleration")
    assert drives(frozenset(drives.elements)).problem.covariates["wheel_speed"].min() > 0
    equations, applicable = with_library(smooth_equations(problem), library())
    names = ("coulomb-friction", "bearing-drag", "rotor-inertia")
    terms = [term_of(equations, name) for name in names]
    found = with_experiment(names, experimenter_of(equations, THRESHOLD), (), terms)
    assert "pump speed" in found.experiment
    assert {"wheel_speed"} <= set(found.vary)
    assert DIRECTION not in found.vary
    told = [found.experiment, *(each.instruction(problem.simulation) for each in applicable)]
    assert [text for text in told if re.search(r"both ways|to and fro|reverse|backwards", text)] == []


def test_a_range_is_told_in_its_unit_or_in_shares_of_the_usual() -> None:
    """What is next to nothing is 0."""
    problem = replace(problem_of(table()), labels={"torque": "shaft torque (N·m)"})
    one = np.ones(AXES)
    recorded = Setting("torque", "torque_Nm", one, 0 * one, 9.6e-8, 7.0)
    assert range_in_words(problem, recorded) == "shaft torque 0 to 7 N·m"
    by_load = Setting("torque", "load_kg", one, 0 * one, 0.5, 1.5, relative=True)
    assert range_in_words(problem, by_load) == "load 0.5 to 1.5 times the usual"
