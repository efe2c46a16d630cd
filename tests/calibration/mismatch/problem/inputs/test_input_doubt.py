"""How uncertain a prediction is by its inputs' errors, and what a comparison makes of it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import heated_room
import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, SensorError, Simulation, compare
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.inputs.input_doubt import DRAWS, LEAST_LEFT, input_doubt
from regolithd.calibration.mismatch.problem.simulated import inputs_of
from regolithd.calibration.mismatch.regression.equations import smooth_equations
from regolithd.calibration.mismatch.regression.group import Term
from regolithd.calibration.mismatch.regression.normal_equations import BY_ERRORS
from regolithd.calibration.mismatch.regression.residuals import residual_of
from regolithd.calibration.mismatch.selection.best_subsets import best_of_each_smooth_term
from regolithd.calibration.mismatch.selection.noise_estimation import fit_of_significant_terms, whitened

if TYPE_CHECKING:
    from collections.abc import Mapping

Array = NDArray[np.float64]
COUNT, WHEELS, ERROR_M_S = 3000, 4, 0.001
STATED = {"stiffness_A": 12.0, "offset_A": 1.0}


class Slipping(Simulation):
    """The current of wheels whose slip is a quotient of two speeds: steep where both are small."""

    channel, unit, wheel_column = "current_A", "A", "wheel"
    inputs = ("wheel_m_s", "ground_m_s")
    parameters: ClassVar = {"stiffness_A": Prior(12.0, 0.6, "A"), "offset_A": Prior(1.0, 0.1, "A")}
    sensors: ClassVar = {"ground_m_s": SensorError(absolute=ERROR_M_S)}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return a current that saturates with the slip."""
        slip = 1 - inputs["ground_m_s"] / inputs["wheel_m_s"]
        return values["offset_A"] + values["stiffness_A"] * np.tanh(8 * slip)

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed and the slip."""
        return {"wheel_speed": inputs["wheel_m_s"], "slip": 1 - inputs["ground_m_s"] / inputs["wheel_m_s"]}


def driven(seed: int, noise: float = 0.8) -> Recording:
    """Return a drive with starts and stops, whose ground speed is read with an error, the same on all wheels."""
    random, t_s = np.random.default_rng(seed), 0.5 * np.arange(COUNT)
    phase = (t_s % 50) / 50
    wheel = 0.03 + 0.2 * np.clip(np.minimum(phase, 1 - phase) * 10, 0, 1)
    slip = np.repeat(random.uniform(-0.05, 0.25, COUNT // 6), 6)
    true = wheel * (1 - slip)
    read = true + ERROR_M_S * random.normal(size=COUNT)
    current = 0.95 + 12.3 * np.tanh(8 * slip)
    columns = {
        "t_s": np.repeat(t_s, WHEELS),
        "wheel": np.tile(np.arange(1.0, WHEELS + 1), COUNT),
        "wheel_m_s": np.repeat(wheel, WHEELS),
        "ground_m_s": np.repeat(read, WHEELS),
        "current_A": np.repeat(current, WHEELS) + noise * random.normal(size=COUNT * WHEELS),
    }
    return from_columns(columns)


def test_the_doubt_is_what_the_error_changes() -> None:
    """By the slope of the prediction, to first order; wheels with one sensor are as uncertain together as alone."""
    recording = driven(1)
    found = input_doubt(recording, recording, Slipping(), STATED, Slipping.sensors)
    assert found is not None
    wheel, ground = recording.channels["wheel_m_s"], recording.channels["ground_m_s"]
    slope = 12 * 8 * (1 - np.tanh(8 * (1 - ground / wheel)) ** 2) / wheel
    small = slope * ERROR_M_S < 0.3
    np.testing.assert_allclose(np.sqrt(found.alone[small]), slope[small] * ERROR_M_S, rtol=0.4)
    assert np.median(np.sqrt(found.alone) / (slope * ERROR_M_S)) == pytest.approx(1, abs=0.05)
    np.testing.assert_allclose(found.together, WHEELS * found.alone)


def test_smoothing_takes_a_part_of_the_error_out_of_each_reading_and_not_out_of_their_mean() -> None:
    """Of a speed that hardly changes, as good as all: what is left is slow."""
    slow = driven(2)
    ground = np.broadcast_to(0.1 + 0.001 * np.sin(slow.time_s / 300)[:, None], slow.shape)
    error = ERROR_M_S * np.random.default_rng(6).normal(size=(COUNT, 1))
    slow = slow.with_channels(ground_m_s=ground + error, wheel_m_s=np.full(slow.shape, 0.11))
    inputs = inputs_of(slow, Slipping())
    assert inputs.doubt is not None
    as_read = input_doubt(slow, slow, Slipping(), STATED, Slipping.sensors)
    assert as_read is not None
    left = np.mean(inputs.doubt.alone) / np.mean(as_read.alone)
    assert 0.9 * LEAST_LEFT < left < 0.2
    assert np.mean(inputs.doubt.together) == pytest.approx(np.mean(as_read.together), rel=0.2)


def test_without_an_error_there_is_no_doubt() -> None:
    """Nothing is computed, and all readings weigh alike."""

    class Exact(Slipping):
        """The same with exact inputs."""

        sensors: ClassVar = {}

    recording = driven(3)
    assert input_doubt(recording, recording, Exact(), STATED, {}) is None
    equations = smooth_equations(build_problem(recording, Exact()))
    left = residual_of(equations, fit_of_significant_terms(equations))
    assert whitened(equations, left).design.reliability is None


def test_readings_in_doubt_weigh_less() -> None:
    """The slowest half of the quickest, or less, and columns as the residual does."""
    problem = build_problem(driven(3), Slipping())
    equations = smooth_equations(problem)
    left = residual_of(equations, fit_of_significant_terms(equations))
    design = whitened(equations, left).design
    assert design.reliability is not None
    weight = design.in_time(design.reliability.in_means)
    wheel = problem.recording.channels["wheel_m_s"]
    assert np.mean(weight[wheel < 0.05]) < 0.5 * np.mean(weight[wheel > 0.22])
    column = problem.tangent("stiffness_A")
    course = design.course_of((0, 1, 2, 3))
    np.testing.assert_allclose(
        course.whitened(column[None])[0],
        course.arranged(design.whitened(design.in_folds(column).astype(np.float32))),
        atol=1e-5,
    )


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_errors_of_a_common_speed_near_standstill_are_no_physics(seed: int) -> None:
    """Nothing is left out of this simulation but the errors of its inputs."""
    found = compare(driven(seed), Slipping()).answer
    assert found.verdict == "consistent", [effect.name for effect in found.effects]
    assert all(each.prior_stds_away < 3 for each in found.parameters)


class Ramping(Simulation):
    """A current that rises with the slip, of wheels whose ground speed is read less often."""

    channel, unit, wheel_column = "current_A", "A", "wheel"
    inputs = ("wheel_m_s", "ground_m_s")
    parameters: ClassVar = {"stiffness_A": Prior(12.0, 0.6, "A"), "offset_A": Prior(1.0, 0.1, "A")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return a current that saturates with the slip."""
        slip = 1 - inputs["ground_m_s"] / inputs["wheel_m_s"]
        return values["offset_A"] + values["stiffness_A"] * np.tanh(2 * slip)

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed and the slip."""
        return {"wheel_speed": inputs["wheel_m_s"], "slip": 1 - inputs["ground_m_s"] / inputs["wheel_m_s"]}


def slowly_read(seed: int) -> Recording:
    """Return a drive whose wheels start and stop within two seconds, with a ground speed every two seconds."""
    random, t_s = np.random.default_rng(seed), 0.5 * np.arange(COUNT)
    phase = (t_s % 40) / 40
    wheel = 0.03 + random.uniform(0.1, 0.3, COUNT // 80 + 1)[np.arange(COUNT) // 80] * np.clip(
        np.minimum(phase, 1 - phase) * 20, 0, 1
    )
    slip = 0.05 + 0.1 * np.sin(t_s / 30) ** 2
    true = wheel * (1 - slip)
    current = 1.0 + 12.1 * np.tanh(2 * slip) + 0.3 * random.normal(size=COUNT)
    read = np.where(np.arange(COUNT) % 4 == 0, true, np.nan)
    return from_columns({"t_s": t_s, "wheel_m_s": wheel, "ground_m_s": read, "current_A": current})


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_straight_line_across_a_start_is_no_physics(seed: int) -> None:
    """Slip is wrong between two readings of the ground speed while the wheels start: those rows are left out."""
    recording = slowly_read(seed)
    problem = build_problem(recording, Ramping())
    (left,) = [each for each in problem.left_out if "changed between its readings" in each.reason]
    assert left.reason.startswith("ground_m_s")
    assert 0.02 * COUNT < left.readings < 0.3 * COUNT
    known = np.isfinite(recording.channels["ground_m_s"])
    assert problem.mask[known].all()  # where it was read
    found = compare(recording, Ramping()).answer
    assert found.verdict == "consistent", [effect.name for effect in found.effects]


def test_errors_that_a_state_adds_up_last_and_others_do_not() -> None:
    """The room's temperature wanders by the error of its heater's current; a current of its own does not."""
    inputs = inputs_of(heated_room.recorded(1), heated_room.ReadRoom())
    assert inputs.doubt is not None
    draws = inputs.doubt.draws
    assert draws.shape == (DRAWS, heated_room.ROWS, 1)
    assert np.corrcoef(draws[0, 1:, 0], draws[0, :-1, 0])[0, 1] > 0.9
    static = inputs_of(driven(1), Slipping())
    assert static.doubt is not None
    assert len(static.doubt.draws) == 0


def test_the_mean_of_a_square_is_more_than_the_square_of_the_mean() -> None:
    """By the variance that smoothing leaves of the current, times the warmth of one square ampere."""
    recording = heated_room.recorded(1)
    inputs = inputs_of(recording, heated_room.ReadRoom())
    assert inputs.doubt is not None
    taken_out = recording.channels["heater_A"] - inputs.expected.channels["heater_A"]
    left = heated_room.ERROR_A**2 - float(np.mean(taken_out**2))
    bias = inputs.doubt.bias[heated_room.ROWS // 2 :]
    assert float(np.mean(bias)) == pytest.approx(heated_room.TRUE["warmth_K_A2"] * left, rel=0.1)


def test_intervals_have_the_errors_that_a_state_adds_up() -> None:
    """Of ten rooms with nothing left out, nine in ten intervals hold the truth, and nothing is unexplained."""
    answers = [compare(heated_room.recorded(seed), heated_room.ReadRoom()).answer for seed in range(10)]
    assert [answer.verdict for answer in answers] == ["consistent"] * 10
    held = [each.low < heated_room.TRUE[each.name] < each.high for answer in answers for each in answer.parameters]
    assert 16 <= sum(held) <= 20


class Braked(Slipping):
    """A motor whose brake holds it at rest: there is no current where the speed reads 0."""

    inputs = ("ground_m_s",)
    parameters: ClassVar = {"idle_A": Prior(20.0, 1.0, "A")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the idle current where the motor turns."""
        return np.where(inputs["ground_m_s"] == 0, 0.0, values["idle_A"])


def test_a_column_that_is_at_rest_is_not_in_doubt() -> None:
    """A step of the prediction beside 0 is no error of it where the reading is known to be 0."""
    moving = driven(1)
    rest = np.arange(COUNT) % 100 < 30
    ground = np.where(rest[:, None], 0.0, moving.channels["ground_m_s"])
    recording = moving.with_channels(ground_m_s=ground)
    found = input_doubt(recording, recording, Braked(), {"idle_A": 20.0}, Braked.sensors)
    assert found is not None
    assert not found.alone.any()
    assert not found.bias.any()


class Rubbing(Braked):
    """A motor whose friction reverses with the speed."""

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the friction."""
        return np.sign(inputs["ground_m_s"]) * values["idle_A"]


def test_a_motion_from_a_rest_is_in_no_doubt_of_its_direction() -> None:
    """Its first and last readings may be within their error of 0: friction does not reverse there by it."""
    still = driven(1)
    phase = (np.arange(COUNT) + 15) % 100  # from rest to rest
    ground = np.where(phase < 30, 0.0, np.minimum(phase - 29, 100 - phase) * 0.0003)[:, None] * np.ones(still.shape)
    recording = still.with_channels(ground_m_s=ground)
    error = Rubbing.sensors["ground_m_s"].absolute
    assert np.any((ground > 0) & (ground < error))
    found = input_doubt(recording, recording, Rubbing(), {"idle_A": 20.0}, Rubbing.sensors)
    assert found is not None
    assert not found.alone.any()
    assert not found.bias.any()


def test_a_term_has_to_gain_more_than_lasting_errors_give_it() -> None:
    """What a curve over time gains in the residuals that the errors alone leave, and four times the mean of that."""
    equations = smooth_equations(build_problem(heated_room.recorded(2), heated_room.ReadRoom()))
    curves = [term for _, term in best_of_each_smooth_term(equations, ()) if term.name == "time"]
    needed = equations.needed_beside_errors((), curves[0])
    doubt = equations.problem.doubt
    assert doubt is not None
    gains = []
    for draw in doubt.draws:
        problem = replace(equations.problem, measured=equations.problem.prediction + draw)
        alone = smooth_equations(problem).weighted(equations.weights)
        (same,) = [term for term in alone.design.groups if term.columns == curves[0].group.columns]
        gains.append(alone.fit((Term(same, (0,)),)).delta_chi2)
    assert needed == pytest.approx(BY_ERRORS * float(np.mean(gains)), rel=0.1)
    static = smooth_equations(build_problem(driven(3), Slipping()))
    assert static.needed_beside_errors((), best_of_each_smooth_term(static, ())[0][1]) == 0
