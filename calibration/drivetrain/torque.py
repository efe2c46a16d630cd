"""From motor current to torque at the wheel and back: Eq. 11, and the no-load current that Eq. 11 leaves out.

    T (1 + λ |T|) = f κ ζ_PG ζ_HD η_PG η_HD (I − I_0),   I_0 = sign(ω) (I_c + b |ω|)

f is `gain_factor`; λ, `load_loss_per_Nm`, lets the efficiency depend on the torque (negative: better at high load).
Arrays have the wheel as their last axis, of length six. Currents, speeds and torques are signed alike: positive turns
the wheel forward. With the defaults – no friction, f = 1, λ = 0 – this is the paper's Eq. 11.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from regolithd.calibration.parameters import Drivetrain

Array = NDArray[np.float64]


def no_load_current(motor_speed_rad_s: Array, drivetrain: Drivetrain) -> Array:
    """Return the current that turns motor and gears alone [A], shape (…, 6); zero at standstill."""
    speed = np.asarray(motor_speed_rad_s, np.float64)
    coulomb = np.asarray(drivetrain.no_load_current_A)
    viscous = np.asarray(drivetrain.viscous_current_A_s_per_rad)
    return np.sign(speed) * coulomb + viscous * speed


def wheel_torque(motor_current_A: Array, motor_speed_rad_s: Array, drivetrain: Drivetrain) -> Array:
    """Return the torque at each wheel [N·m], shape (…, 6) (Eq. 11, after the no-load current).

    Where the efficiency grows with torque (λ < 0) there is a current above which the formula has no answer: the torque
    there is 2 f κ … (I − I_0), twice the straight line's. No drivetrain has such an efficiency so far from its brake.
    """
    useful = np.asarray(motor_current_A, np.float64) - no_load_current(motor_speed_rad_s, drivetrain)
    straight = drivetrain.gain_Nm_per_A * np.asarray(drivetrain.gain_factor) * useful
    under = 1 + 4 * np.asarray(drivetrain.load_loss_per_Nm) * np.abs(straight)
    return 2 * straight / (1 + np.sqrt(np.maximum(under, 0.0)))


def motor_current(wheel_torque_Nm: Array, motor_speed_rad_s: Array, drivetrain: Drivetrain) -> Array:
    """Return the motor current that holds a torque at each wheel [A], shape (…, 6): `wheel_torque` inverted."""
    gain = drivetrain.gain_Nm_per_A * np.asarray(drivetrain.gain_factor)
    torque = np.asarray(wheel_torque_Nm, np.float64)
    loss = 1 + np.asarray(drivetrain.load_loss_per_Nm) * np.abs(torque)
    return torque * loss / gain + no_load_current(motor_speed_rad_s, drivetrain)
