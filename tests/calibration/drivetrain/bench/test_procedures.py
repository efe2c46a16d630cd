"""The fits of the bench procedures recover simulated constants within their standard deviations."""

import numpy as np
import pytest

from regolithd.calibration.drivetrain.bench import procedures
from regolithd.calibration.drivetrain.bench.efficiency_fit import EfficiencyFit
from regolithd.calibration.drivetrain.bench.line_fit import BenchError


def test_weights_give_zero_and_span_within_their_errors() -> None:
    """Of 200 cells that read 2 % low with a zero of 1.5 N, most fits are within two standard deviations."""
    inside = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        weights = np.repeat([0.0, 2, 4, 6, 8, 6, 4, 2, 0], 20)
        off_centre = np.repeat(rng.normal(0, 0.05, 9), 20)
        cell = procedures.fit_load_cell(weights, 1.5 + 0.98 * 9.80665 * weights + off_centre + rng.normal(0, 0.5, 180))
        inside.append([abs(cell.zero_N - 1.5) < 2 * cell.zero_std_N, abs(cell.span - 1 / 0.98) < 2 * cell.span_std])
    assert (np.mean(inside, axis=0) > 0.85).all()


def test_a_spin_gives_coulomb_and_viscous_current_in_both_directions() -> None:
    """37 mA and 20 µA s/rad are recovered from a noisy staircase of speeds with ramps between its steps."""
    rng = np.random.default_rng(0)
    steps = np.array([80.0, 160, 240, 320, 400, -80, -160, -240, -320, -400])
    speed = np.concatenate([np.concatenate([np.linspace(0, s, 6), np.full(40, s)]) for s in steps])
    acceleration = np.gradient(speed)
    current = np.sign(speed) * 0.037 + 2e-5 * speed + 1e-3 * acceleration + rng.normal(0, 0.003, speed.size)
    found = procedures.fit_no_load_current(speed, current)
    assert found.coulomb_A == pytest.approx(0.037, abs=3 * found.coulomb_std_A)
    assert found.viscous_A_s_per_rad == pytest.approx(2e-5, abs=3 * found.viscous_std_A_s_per_rad)
    assert found.coulomb_std_A < 0.002


STAIRS = np.repeat([0.0, 0.4, 0.8, 1.2, 1.6, 2.0, 1.6, 1.2, 0.8, 0.4, 0.0], 40)
IDEAL = 0.0234 * 1400


def braked(loss_per_Nm: float, seed: int, torque: np.ndarray = STAIRS) -> EfficiencyFit:
    """Simulate a brake test with a gain factor of 0.9: errors of 1 mA for each step and 4 mA for each sample."""
    rng = np.random.default_rng(seed)
    steps = np.cumsum(np.diff(torque, prepend=0.0) != 0)
    current = 0.037 + torque * (1 + loss_per_Nm * torque) / (0.9 * 16.05)
    current += rng.normal(0, 0.001, steps[-1] + 1)[steps] + rng.normal(0, 0.004, torque.size)
    return procedures.fit_brake(torque, current, 16.05)


def test_a_brake_gives_the_efficiency_against_torque_within_its_errors() -> None:
    """With λ = −0.1 nearly all of 200 fits are load-dependent, and nine in ten intervals hold gain and efficiency."""
    truth = lambda torque: torque / (IDEAL * (0.037 + torque * (1 - 0.1 * torque) / (0.9 * 16.05)))  # noqa: E731
    dependent, inside = [], []
    for seed in range(200):
        found = braked(-0.1, seed)
        dependent.append(found.load_dependent)
        if found.load_dependent:
            at = np.array([0.4, 2.0])
            share, std = found.efficiency(at, IDEAL)
            off = [*np.abs(share - truth(at)) / std, abs(found.gain_factor - 0.9) / found.gain_factor_std]
            inside.append([*(each < 1.86 for each in off), abs(found.load_loss_per_Nm + 0.1) < 0.06])
    assert np.mean(dependent) > 0.95
    assert (np.mean(inside, axis=0) > 0.84).all()  # 1.86: nine tenths of Student's t with 8 degrees of freedom


def test_an_efficiency_that_does_not_depend_on_torque_stays_one_number() -> None:
    """With λ = 0 at most one fit in ten is load-dependent; the others have λ = 0 with a standard deviation."""
    found = [braked(0.0, seed) for seed in range(200)]
    straight = [each for each in found if not each.load_dependent]
    assert len(straight) > 180
    assert all(each.load_loss_per_Nm == 0 and 0.001 < each.load_loss_std_per_Nm < 0.2 for each in straight)
    off = [abs(each.gain_factor - 0.9) < 1.83 * each.gain_factor_std for each in straight]
    assert np.mean(off) > 0.84
    no_load = [abs(each.no_load_A - 0.037) < 1.83 * each.no_load_std_A for each in straight]
    assert np.mean(no_load) > 0.84


def test_three_torques_give_a_gain_and_no_load_loss() -> None:
    """With three torques no load loss is fitted, and its value and standard deviation are zero."""
    found = braked(-0.1, 0, np.repeat([0.0, 1.0, 2.0], 40))
    assert not found.load_dependent
    assert found.load_loss_per_Nm == found.load_loss_std_per_Nm == 0


def test_a_distance_gives_the_radius() -> None:
    """Ten metres in 133.3 rad of the wheel are 75 mm, with the standard deviation of tape and sampling."""
    time = np.arange(0, 460, 0.5)
    speed = np.where((time > 2) & (time < 452), 10 / 0.075 * 1400 / 450, 0.0)
    found = procedures.fit_radius(time, speed, 1400, 10.0, 0.01)
    assert found.radius_m == pytest.approx(0.075, abs=2 * found.radius_std_m)
    assert found.radius_std_m < 2e-4


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: procedures.fit_load_cell(np.repeat([0.0, 5.0], 9), np.repeat([0.0, 49.0], 9)), "at least three"),
        (lambda: procedures.fit_no_load_current(np.zeros(50), np.zeros(50)), "never turned"),
        (lambda: braked(0.0, 0, np.repeat([0.0, 1.0], 9)), "brake with at least three"),
        (lambda: procedures.fit_brake(STAIRS, 0.2 - 0.05 * STAIRS, 16.05), "does not grow"),
        (lambda: procedures.fit_radius(np.arange(9.0), np.ones(9), 1400, 1.0, 0.01), "at least one whole turn"),
    ],
)
def test_a_recording_without_what_is_needed_is_an_error(call: object, message: str) -> None:
    """The message names what is missing in the recording."""
    with pytest.raises(BenchError, match=message):
        call()  # type: ignore[operator]
