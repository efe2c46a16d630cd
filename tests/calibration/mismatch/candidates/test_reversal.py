"""The direction of motion in laws of friction: a step, or the transition that a recording shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_machine import AXES, STEP_S, problem_of, table

from regolithd.calibration.mismatch.candidates.bearing_drag import BearingDrag
from regolithd.calibration.mismatch.candidates.coulomb_friction import CoulombFriction
from regolithd.calibration.mismatch.candidates.motion import along_motion
from regolithd.calibration.mismatch.candidates.reversal import TRANSITIONS, reversal_of
from regolithd.calibration.mismatch.candidates.stribeck_friction import StribeckFriction

FASTEST = 2.0
"""About the highest usual speed of the linear machine [rad/s]."""
RIPPLE = 1.0
"""Cycles of a ripple in a turn."""


def with_friction(transition_rad_s: float, noise: float = 0.05) -> dict[str, np.ndarray]:
    """Return a recording with a friction that reverses within a speed; 0: at once."""
    columns = table(noise=noise)
    speed = columns["speed_rad_s"]
    turned = np.tanh(speed / transition_rad_s) if transition_rad_s else np.sign(speed)
    return {**columns, "reading_V": columns["reading_V"] + 0.8 * turned}


def test_a_step_stays_a_step() -> None:
    """Friction that reverses at once has no transition in its shape."""
    assert reversal_of(problem_of(with_friction(0.0))) == {}


def test_drag_that_decays_from_standstill_is_no_gradual_reversal() -> None:
    """On a machine that turns one way, and on one that reverses at once."""
    columns = table(noise=0.02)
    for speed in (np.abs(columns["speed_rad_s"]), columns["speed_rad_s"]):
        drag = np.sign(speed) * (0.2 + 0.8 * np.exp(-((speed / (0.1 * FASTEST)) ** 2)))
        problem = problem_of({**columns, "speed_rad_s": speed, "reading_V": columns["reading_V"] + drag})
        assert reversal_of(problem) == {}
        assert not any("transition_rad_s" in shape for shape in StribeckFriction().shapes(problem))


def test_a_stribeck_effect_fades_after_the_friction_has_turned_round() -> None:
    """What fades sooner is another form of the transition; without one, any speed is tried."""
    turn = TRANSITIONS[-1] * FASTEST
    problem, candidate = problem_of(with_friction(turn)), StribeckFriction()
    speeds = {"with": [], "without": []}
    for shape in candidate.shapes(problem):
        kind = "with" if "transition_rad_s" in shape else "without"
        speeds[kind].append(float(shape["stribeck_speed_rad_s"]))
    (found,) = {float(shape["transition_rad_s"]) for shape in candidate.shapes(problem) if "transition_rad_s" in shape}
    assert min(speeds["with"]) >= found > min(speeds["without"])
    assert candidate.bounds(problem, {"transition_rad_s": found})["stribeck_speed_rad_s"][0] == found


def test_viscous_friction_of_one_axis_is_no_gradual_reversal() -> None:
    """Constant friction of that axis would seem to be less at low speeds."""
    columns = table(noise=0.02)
    speed, one = columns["speed_rad_s"], np.arange(len(columns["t_s"])) % AXES == 0
    drag = 0.3 * one * speed
    assert reversal_of(problem_of({**columns, "reading_V": columns["reading_V"] + drag})) == {}


def test_without_friction_there_is_no_transition() -> None:
    """Noise alone prefers no transition."""
    assert reversal_of(problem_of(table())) == {}


@pytest.mark.parametrize("period", [12, 40])
def test_inertia_is_no_friction_that_follows_the_displacement(period: int) -> None:
    """A machine that turns round within some readings: its inertia acts about reversals alone."""
    columns = table(noise=0.05)
    triangle = np.arcsin(np.sin(2 * np.pi * np.arange(len(columns["t_s"]) // AXES) / period))
    speed = FASTEST * np.clip(triangle, -1, 1)
    inertia = np.repeat(0.3 * np.gradient(speed, STEP_S), AXES)
    recorded = {"speed_rad_s": np.repeat(speed, AXES), "reading_V": columns["reading_V"] + inertia}
    assert reversal_of(problem_of({**columns, **recorded})) == {}


def test_a_drive_that_was_simulated_without_noise_has_none() -> None:
    """A proposed experiment's readings are its prediction: there is nothing to explain."""
    assert reversal_of(problem_of(table(noise=0.0))) == {}


def test_a_smooth_reversal_is_found() -> None:
    """The nearest of the transitions that are looked for, as a speed of this machine."""
    found = reversal_of(problem_of(with_friction(TRANSITIONS[-1] * FASTEST)))
    assert float(found["transition_rad_s"]) == pytest.approx(TRANSITIONS[-1] * FASTEST, rel=0.25)


@pytest.mark.parametrize("between", [0.013, 0.03])
def test_a_transition_between_those_that_are_tried_is_refined(between: float) -> None:
    """What is left of a friction near standstill would else be taken for a law of low speeds."""
    found = reversal_of(problem_of(with_friction(between * FASTEST, noise=0.02)))
    assert float(found["transition_rad_s"]) == pytest.approx(between * FASTEST, rel=0.15)


def test_noise_with_a_memory_does_not_hide_a_transition() -> None:
    """A slow wander of the reading holds far more power than the few readings of each reversal."""
    columns = with_friction(0.03 * FASTEST, noise=0.02)
    of_axes = np.random.default_rng(3).normal(0, 0.02, (len(columns["reading_V"]) // 2, 2))
    wander = np.cumsum(of_axes, axis=0).ravel()
    found = reversal_of(problem_of({**columns, "reading_V": columns["reading_V"] + wander}))
    assert float(found["transition_rad_s"]) == pytest.approx(0.03 * FASTEST, rel=0.15)


def with_presliding(presliding_rad: float, noise: float = 0.03) -> dict[str, np.ndarray]:
    """Return a recording with a friction that follows the displacement since each reversal (Dahl, 1968)."""
    columns = table(noise=noise)
    speed = columns["speed_rad_s"].reshape(-1, AXES)
    friction, state, fine = np.zeros(speed.shape), np.sign(speed[0]), 50
    for instant in range(1, len(speed)):
        for step in range(fine):
            between = speed[instant - 1] + (speed[instant] - speed[instant - 1]) * (step + 0.5) / fine
            state = state + (np.sign(between) - state) * np.abs(between) * STEP_S / fine / presliding_rad
        friction[instant] = state
    return {**columns, "reading_V": columns["reading_V"] + 0.8 * friction.ravel()}


@pytest.mark.parametrize("presliding_rad", [0.8, 2.0])
def test_friction_that_follows_the_displacement_is_found(presliding_rad: float) -> None:
    """The linear machine swings by some thirty radians."""
    found = reversal_of(problem_of(with_presliding(presliding_rad)))
    assert found == {"presliding_rad": pytest.approx(presliding_rad, rel=0.2)}


def cycling(presliding_rad: float, ripple: float) -> dict[str, np.ndarray]:
    """Return a machine that goes to and fro between two places, with friction and a ripple in its angle."""
    columns = table(noise=0.05)
    fine = 50
    cycle = 2 * np.pi * np.arange(fine * len(columns["t_s"]) // AXES) / (90 * fine)
    speed = FASTEST * np.clip(3 * np.sin(cycle), -1, 1)
    angle, state = np.cumsum(speed) * STEP_S / fine, np.sign(speed)
    for step in range(1, len(speed) if presliding_rad else 0):
        moved = abs(speed[step]) * STEP_S / fine / presliding_rad
        state[step] = state[step - 1] + (np.sign(speed[step]) - state[step - 1]) * moved
    reading = (0.8 * state + ripple * np.cos(RIPPLE * angle))[::fine]
    read = {"speed_rad_s": np.repeat(speed[::fine], AXES), "reading_V": np.repeat(reading, AXES) + columns["reading_V"]}
    return {**columns, **read}


@pytest.mark.parametrize(("presliding_rad", "ripple"), [(0.0, 2.0), (4.0, 1.2)])
def test_a_ripple_of_a_machine_that_turns_round_at_the_same_places_is_no_reversal(
    presliding_rad: float, ripple: float
) -> None:
    """After each reversal it has the same course, as friction that follows the displacement has."""
    found = reversal_of(problem_of(cycling(presliding_rad, ripple)))
    assert found == ({"presliding_rad": pytest.approx(presliding_rad, rel=0.03)} if presliding_rad else {})


def test_the_friction_of_one_axis_alone_shows_how_it_reverses() -> None:
    """Of both axes together it is half as large, and the other half of the readings contradicts it."""
    still, rubbing = table(noise=0.2)["reading_V"], with_presliding(2.0, noise=0.2)
    first = rubbing["axis"] == 1
    found = reversal_of(problem_of({**rubbing, "reading_V": np.where(first, rubbing["reading_V"], still)}))
    assert found == {"presliding_rad": pytest.approx(2.0, rel=0.25)}


def test_friction_that_follows_the_displacement_has_its_state_from_before() -> None:
    """It follows the displacement, whatever the speed; a run begins with all of it."""
    problem = problem_of(with_presliding(2.0))
    along, direction = along_motion(problem, {"presliding_rad": 2.0}), problem.covariates["direction"]
    begin = int(np.flatnonzero(direction[:, 1])[0])
    assert along[begin, 1] == direction[begin, 1]
    turned = int(np.flatnonzero(np.diff(direction[:, 1]))[0]) + 1
    assert abs(along[turned, 1] - along[turned - 1, 1]) < 0.5
    assert np.abs(along).max() <= 1.0


def test_every_law_that_reverses_has_it_in_its_shape() -> None:
    """So that a corrected simulation gives the same on another recording, whatever that one shows."""
    problem = problem_of(with_friction(TRANSITIONS[-1] * FASTEST))
    for candidate in (CoulombFriction(), BearingDrag()):
        assert all("transition_rad_s" in shape for shape in candidate.shapes(problem))
    (column,) = CoulombFriction().columns(problem, {"transition_rad_s": 0.5})
    speed, direction = problem.covariates["wheel_speed"], problem.covariates["direction"]
    assert column == pytest.approx(np.where(direction == 0, 0.0, np.tanh(speed / 0.5)))


def test_friction_of_a_late_channel_is_looked_for_late() -> None:
    """On time it seems to turn round with the way; a copy of the problem that knows the delay asks anew."""
    columns = table(noise=0.02)
    drag = 0.8 * np.sign(columns["speed_rad_s"].reshape(-1, AXES))
    late = np.vstack((np.repeat(drag[:1], 4, axis=0), drag[:-4]))
    problem = problem_of({**columns, "reading_V": columns["reading_V"] + late.ravel()})
    assert reversal_of(problem) != {}
    assert reversal_of(replace(problem, late=("secant_s", 4 * STEP_S))) == {}


def test_a_shape_without_a_transition_is_a_step() -> None:
    """Files that were corrected before keep their meaning."""
    problem = problem_of(table())
    assert set(np.unique(along_motion(problem, {}))) <= {-1.0, 0.0, 1.0}
