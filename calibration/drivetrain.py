"""From motor current to torque at the wheel and back: Eq. 11, and the no-load current that Eq. 11 leaves out.

    T = κ ζ_PG ζ_HD η_PG η_HD (I − I_0),   I_0 = sign(ω) (I_c + b |ω|)

Arrays have the wheel as their last axis, of length six. Currents, speeds and torques are signed alike: positive turns
the wheel forward. With the default of no friction this is the paper's Eq. 11.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from calibration.parameters import Drivetrain

Array = NDArray[np.float64]


def no_load_current(motor_speed_rad_s: Array, drivetrain: Drivetrain) -> Array:
    """Return the current that turns motor and gears alone [A], shape (…, 6); zero at standstill."""
    speed = np.asarray(motor_speed_rad_s, np.float64)
    coulomb = np.asarray(drivetrain.no_load_current_A)
    viscous = np.asarray(drivetrain.viscous_current_A_s_per_rad)
    return np.sign(speed) * coulomb + viscous * speed


def wheel_torque(motor_current_A: Array, motor_speed_rad_s: Array, drivetrain: Drivetrain) -> Array:
    """Return the torque at each wheel [N·m], shape (…, 6) (Eq. 11, after the no-load current)."""
    useful = np.asarray(motor_current_A, np.float64) - no_load_current(motor_speed_rad_s, drivetrain)
    return drivetrain.gain_Nm_per_A * np.asarray(drivetrain.gain_factor) * useful


def motor_current(wheel_torque_Nm: Array, motor_speed_rad_s: Array, drivetrain: Drivetrain) -> Array:
    """Return the motor current that holds a torque at each wheel [A], shape (…, 6): `wheel_torque` inverted."""
    gain = drivetrain.gain_Nm_per_A * np.asarray(drivetrain.gain_factor)
    return np.asarray(wheel_torque_Nm, np.float64) / gain + no_load_current(motor_speed_rad_s, drivetrain)
