"""The bench procedures find what was put in, say how sure they are, and leave the user's file as it was."""

from pathlib import Path

import numpy as np
import pytest

from regolithd.calibration.drivetrain.bench import procedures
from regolithd.calibration.drivetrain.bench.efficiency import Efficiency
from regolithd.calibration.drivetrain.bench.line import BenchError
from regolithd.calibration.drivetrain.bench.toml_edit import set_value

ROVER_TOML = Path(__file__).resolve().parents[3] / "rover.toml"


def test_weights_give_zero_and_span_within_their_errors() -> None:
    """Of 200 cells that read 2 % low with 1.5 N of zero, the truth lies within two deviations in most."""
    inside = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        weights = np.repeat([0.0, 2, 4, 6, 8, 6, 4, 2, 0], 20)
        askew = np.repeat(rng.normal(0, 0.05, 9), 20)
        cell = procedures.load_cell(weights, 1.5 + 0.98 * 9.80665 * weights + askew + rng.normal(0, 0.5, 180))
        inside.append([abs(cell.zero_N - 1.5) < 2 * cell.zero_std_N, abs(cell.span - 1 / 0.98) < 2 * cell.span_std])
    assert (np.mean(inside, axis=0) > 0.85).all()


def test_a_spin_gives_coulomb_and_viscous_current_in_both_directions() -> None:
    """37 mA and 20 µA s/rad come back from a noisy staircase with ramps between its steps."""
    rng = np.random.default_rng(0)
    steps = np.array([80.0, 160, 240, 320, 400, -80, -160, -240, -320, -400])
    speed = np.concatenate([np.concatenate([np.linspace(0, s, 6), np.full(40, s)]) for s in steps])
    acceleration = np.gradient(speed)
    current = np.sign(speed) * 0.037 + 2e-5 * speed + 1e-3 * acceleration + rng.normal(0, 0.003, speed.size)
    found = procedures.wheels_up(speed, current)
    assert found.coulomb_A == pytest.approx(0.037, abs=3 * found.coulomb_std_A)
    assert found.viscous_A_s_per_rad == pytest.approx(2e-5, abs=3 * found.viscous_std_A_s_per_rad)
    assert found.coulomb_std_A < 0.002


STAIRS = np.repeat([0.0, 0.4, 0.8, 1.2, 1.6, 2.0, 1.6, 1.2, 0.8, 0.4, 0.0], 40)
IDEAL = 0.0234 * 1400


def braked(loss_per_Nm: float, seed: int, torque: np.ndarray = STAIRS) -> Efficiency:
    """Brake a wheel with a tenth less gain than Eq. 11 says: each step is off by 1 mA, each sample by 4 mA."""
    rng = np.random.default_rng(seed)
    steps = np.cumsum(np.diff(torque, prepend=0.0) != 0)
    current = 0.037 + torque * (1 + loss_per_Nm * torque) / (0.9 * 16.05)
    current += rng.normal(0, 0.001, steps[-1] + 1)[steps] + rng.normal(0, 0.004, torque.size)
    return procedures.brake(torque, current, 16.05)


def test_a_brake_gives_the_efficiency_against_torque_within_its_errors() -> None:
    """Of 200 wheels that are better at load, nearly all show it, and nine in ten intervals hold gain and efficiency."""
    truth = lambda torque: torque / (IDEAL * (0.037 + torque * (1 - 0.1 * torque) / (0.9 * 16.05)))  # noqa: E731
    bent, inside = [], []
    for seed in range(200):
        found = braked(-0.1, seed)
        bent.append(found.bent)
        if found.bent:
            at = np.array([0.4, 2.0])
            share, std = found.efficiency(at, IDEAL)
            off = [*np.abs(share - truth(at)) / std, abs(found.gain_factor - 0.9) / found.gain_factor_std]
            inside.append([*(each < 1.86 for each in off), abs(found.load_loss_per_Nm + 0.1) < 0.06])
    assert np.mean(bent) > 0.95
    assert (np.mean(inside, axis=0) > 0.84).all()  # 1.86: nine tenths of Student's t with 8 degrees of freedom


def test_an_efficiency_that_does_not_depend_on_torque_stays_one_number() -> None:
    """Of 200 straight wheels about one in twenty is called bent; the others' λ is zero, give or take what is told."""
    found = [braked(0.0, seed) for seed in range(200)]
    straight = [each for each in found if not each.bent]
    assert len(straight) > 180
    assert all(each.load_loss_per_Nm == 0 and 0.001 < each.load_loss_std_per_Nm < 0.2 for each in straight)
    off = [abs(each.gain_factor - 0.9) < 1.83 * each.gain_factor_std for each in straight]
    assert np.mean(off) > 0.84
    no_load = [abs(each.no_load_A - 0.037) < 1.83 * each.no_load_std_A for each in straight]
    assert np.mean(no_load) > 0.84


def test_three_torques_give_a_gain_and_say_nothing_of_its_bend() -> None:
    """What cannot be told is not told."""
    found = braked(-0.1, 0, np.repeat([0.0, 1.0, 2.0], 40))
    assert not found.bent
    assert found.load_loss_per_Nm == found.load_loss_std_per_Nm == 0


def test_a_distance_gives_the_radius() -> None:
    """Ten metres in 133.3 rad of wheel are 75 mm, as sure as the tape and the sampling."""
    time = np.arange(0, 460, 0.5)
    speed = np.where((time > 2) & (time < 452), 10 / 0.075 * 1400 / 450, 0.0)
    found = procedures.radius(time, speed, 1400, 10.0, 0.01)
    assert found.radius_m == pytest.approx(0.075, abs=2 * found.radius_std_m)
    assert found.radius_std_m < 2e-4


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: procedures.load_cell(np.repeat([0.0, 5.0], 9), np.repeat([0.0, 49.0], 9)), "at least three"),
        (lambda: procedures.wheels_up(np.zeros(50), np.zeros(50)), "never turned"),
        (lambda: braked(0.0, 0, np.repeat([0.0, 1.0], 9)), "brake with at least three"),
        (lambda: procedures.brake(STAIRS, 0.2 - 0.05 * STAIRS, 16.05), "does not grow"),
        (lambda: procedures.radius(np.arange(9.0), np.ones(9), 1400, 1.0, 0.01), "at least one whole turn"),
    ],
)
def test_a_recording_without_what_is_needed_says_so(call: object, says: str) -> None:
    """The message tells the person at the bench what is missing."""
    with pytest.raises(BenchError, match=says):
        call()  # type: ignore[operator]


def test_the_users_comments_stay() -> None:
    """Of the shipped file only the value changes; a new key and a new table go where they belong."""
    before = ROVER_TOML.read_text(encoding="utf-8")
    after = set_value(before, "drivetrain", "no_load_current_A", [0.0371, 0.036, 0.04, 0.033, 0.035, 0.036])
    changed = [(a, b) for a, b in zip(before.splitlines(), after.splitlines(), strict=True) if a != b]
    assert len(changed) == 1
    assert changed[0][1].startswith("no_load_current_A = [0.0371, 0.036, 0.04, 0.033, 0.035, 0.036]")
    assert changed[0][1].endswith(changed[0][0].split("#")[1])
    assert "# Maxon RE 25, 24 V winding" in after
    added = set_value(set_value(before, "wheel", "radius_std_m", 0.0002), "new", "value", 3.0)
    assert added.index("radius_std_m") < added.index("[drivetrain]") < added.index("[new]")
