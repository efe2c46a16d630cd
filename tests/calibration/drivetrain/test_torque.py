"""Torque from current and current from torque: Eq. 11, no-load current and load loss."""

import csv
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from regolithd.calibration.drivetrain.torque import motor_current, no_load_current, wheel_torque
from regolithd.calibration.parameters import Drivetrain

FRICTION = Drivetrain(no_load_current_A=(0.03, 0.031, 0.037, 0.04, 0.033, 0.036), viscous_current_A_s_per_rad=2e-5)  # type: ignore[arg-type]


def test_without_friction_it_is_equation_11() -> None:
    """With the defaults 80 mA give κ ζ_PG ζ_HD η_PG η_HD I = 0.0234 · 1400 · 0.49 · 0.08 N·m."""
    torque = wheel_torque(np.full(6, 0.080), np.full(6, 400.0), Drivetrain())
    np.testing.assert_allclose(torque, 0.0234 * 14 * 100 * 0.7 * 0.7 * 0.080)


@given(torque=st.floats(-4, 4), speed=st.floats(-900, 900), loss=st.floats(-0.12, 0.5))
def test_current_and_torque_invert_each_other(torque: float, speed: float, loss: float) -> None:
    """For any torque and speed, and for λ of either sign, torque to current and back is the same torque."""
    torques, speeds = np.full(6, torque), np.full(6, speed)
    drivetrain = FRICTION.model_copy(update={"load_loss_per_Nm": (loss,) * 6, "gain_factor": (0.9,) * 6})
    back = wheel_torque(motor_current(torques, speeds, drivetrain), speeds, drivetrain)
    np.testing.assert_allclose(back, torques, atol=1e-12)


def test_efficiency_follows_the_torque() -> None:
    """With λ = 0.1 /(N·m) the current is a fifth larger at 2 N·m, and zero at no torque."""
    lossy = Drivetrain(load_loss_per_Nm=0.1)  # type: ignore[arg-type]  # one value for six wheels
    torque, speed = np.array([0.0, 0.5, 1.0, 2.0, -2.0, 4.0]), np.full(6, 400.0)
    ratio = motor_current(torque, speed, lossy)[1:] / motor_current(torque, speed, Drivetrain())[1:]
    np.testing.assert_allclose(ratio, [1.05, 1.1, 1.2, 1.2, 1.4])
    assert motor_current(torque, speed, lossy)[0] == 0


def test_torque_beyond_the_formulas_range_is_finite() -> None:
    """With λ < 0 and a current above the formula's range the torque is finite and increases with the current."""
    better = Drivetrain(load_loss_per_Nm=-0.2)  # type: ignore[arg-type]  # one value for six wheels
    torque = wheel_torque(np.linspace(0, 1.0, 6), np.full(6, 400.0), better)
    assert (np.diff(torque) > 0).all()
    assert np.isfinite(torque).all()


def test_no_load_current_is_odd_in_speed_and_zero_at_standstill() -> None:
    """The no-load current is an odd function of speed, and zero at standstill."""
    speed = np.linspace(10, 400, 6)
    np.testing.assert_allclose(no_load_current(-speed, FRICTION), -no_load_current(speed, FRICTION))
    np.testing.assert_array_equal(no_load_current(np.zeros(6), FRICTION), 0)


def test_reference_currents_follow_from_reference_torques(shared_folder: Path) -> None:
    """The currents of the reference table are its torques by Eq. 11, to 1e-6."""
    with (shared_folder / "reference" / "rover-wheel.csv").open() as file:
        rows = [(float(row["torque_Nm"]), float(row["motor_current_A"])) for row in csv.DictReader(file)]
    torque, current = np.array(rows).T
    ours = motor_current(np.tile(torque[:, None], 6), np.full(6, 10.0), Drivetrain())
    np.testing.assert_allclose(ours, np.tile(current[:, None], 6), rtol=1e-6)
