"""Drivetrain equations: torque at the wheel from motor current and back (Eq. 11 with no-load current and load loss).

    T (1 + λ |T|) = f G (I − I_0),   G = κ ζ_PG ζ_HD η_PG η_HD,   I_0 = sign(ω) (I_c + b |ω|)

| symbol | field of `parameters.Drivetrain` | meaning |
|---|---|---|
| G | `gain_Nm_per_A` | gain of Eq. 11 |
| f | `gain_factor` | factor on the gain |
| λ | `load_loss_per_Nm` | relative increase of the current per torque; < 0: efficiency grows with torque |
| I_c, b | `no_load_current_A`, `viscous_current_A_s_per_rad` | no-load current: Coulomb and viscous part |

With the defaults (I_c = b = λ = 0, f = 1) this is the paper's Eq. 11. Assumptions: steady state (no inertia), symmetric
in the direction of rotation, rigid gears. Currents, speeds and torques have one sign convention: positive turns the
wheel forward. The last axis of each array is the wheel, of length six.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from regolithd.calibration.parameters import Drivetrain

Array = NDArray[np.float64]


def no_load_current(motor_speed_rad_s: Array, drivetrain: Drivetrain) -> Array:
    """Return the current that turns motor and gears without load: I_0 = sign(ω) I_c + b ω.

    Parameters
    ----------
    motor_speed_rad_s
        Speed ω of the motor, before the gears [rad/s], shape (…, 6).
    drivetrain
        Drivetrain; I_c [A] and b [A·s/rad] are used.

    Returns
    -------
    Array
        No-load current I_0 [A], shape (…, 6); zero at standstill.
    """
    speed = np.asarray(motor_speed_rad_s, np.float64)
    coulomb = np.asarray(drivetrain.no_load_current_A)
    viscous = np.asarray(drivetrain.viscous_current_A_s_per_rad)
    return np.sign(speed) * coulomb + viscous * speed


def wheel_torque(motor_current_A: Array, motor_speed_rad_s: Array, drivetrain: Drivetrain) -> Array:
    """Return the torque at each wheel: the solution of T (1 + λ |T|) = f G (I − I_0) (Eq. 11 for λ = I_0 = 0, f = 1).

    Parameters
    ----------
    motor_current_A
        Motor current I [A], shape (…, 6).
    motor_speed_rad_s
        Speed ω of the motor, before the gears [rad/s], same shape.
    drivetrain
        Drivetrain.

    Returns
    -------
    Array
        Torque T [N·m], shape (…, 6).

    Notes
    -----
    With T_0 = f G (I − I_0) the solution is T = 2 T_0 / (1 + √(1 + 4 λ |T_0|)). For λ < 0 it exists up to
    |T_0| = −1/(4 λ); above that the root is taken as zero and T = 2 T_0, so that the result is continuous and finite.
    """
    useful = np.asarray(motor_current_A, np.float64) - no_load_current(motor_speed_rad_s, drivetrain)
    without_loss = drivetrain.gain_Nm_per_A * np.asarray(drivetrain.gain_factor) * useful
    radicand = 1 + 4 * np.asarray(drivetrain.load_loss_per_Nm) * np.abs(without_loss)
    return 2 * without_loss / (1 + np.sqrt(np.maximum(radicand, 0.0)))


def motor_current(wheel_torque_Nm: Array, motor_speed_rad_s: Array, drivetrain: Drivetrain) -> Array:
    """Return the motor current of a torque at each wheel, the inverse of `wheel_torque`: I = T (1 + λ |T|)/(f G) + I_0.

    Parameters
    ----------
    wheel_torque_Nm
        Torque T at the wheel [N·m], shape (…, 6).
    motor_speed_rad_s
        Speed ω of the motor, before the gears [rad/s], same shape.
    drivetrain
        Drivetrain.

    Returns
    -------
    Array
        Motor current I [A], shape (…, 6).
    """
    gain = drivetrain.gain_Nm_per_A * np.asarray(drivetrain.gain_factor)
    torque = np.asarray(wheel_torque_Nm, np.float64)
    loss = 1 + np.asarray(drivetrain.load_loss_per_Nm) * np.abs(torque)
    return torque * loss / gain + no_load_current(motor_speed_rad_s, drivetrain)
