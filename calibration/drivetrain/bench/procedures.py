"""The four bench procedures (known weights, wheels-up spin, brake, measured distance): instructions and fits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.drivetrain.bench.efficiency_fit import EfficiencyFit, fit_efficiency
from regolithd.calibration.drivetrain.bench.line_fit import BenchError, LineFit, fit_line
from regolithd.calibration.parameters import GRAVITY_M_S2

Array = NDArray[np.float64]

LOAD_CELLS = """\
Load cells: zero and span of one wheel's cell.
  1. Lift the wheel off the ground and record ten seconds: 0 kg.
  2. Put known weights on the cell, at least two more of them, up to about 8 kg; ten seconds each.
  3. Take them off in reverse order, to measure hysteresis.
The recording's column `weight_kg` is the weight at each instant; rows without it are ignored."""

WHEELS_UP = """\
Wheels up: the no-load current of the drivetrain.
  1. Put the rover on a stand, all wheels free. Let it run for ten minutes: cold grease increases the friction.
  2. Drive at five speeds or more, forward and backward, twenty seconds each, from a fifth of the usual speed to the
     highest.
  3. Note the temperature: the result is valid for it."""

BRAKE = """\
Brake: the efficiency of one wheel's drivetrain against torque.
  1. Wheels up. Put a brake with a balance on the wheel.
  2. At the usual speed, brake with five torques or more, from zero to about 2 N m, increasing and decreasing; twenty
     seconds each.
The recording's column `brake_torque_Nm` is the torque at each instant; rows without it are ignored."""

RADIUS = """\
Wheel radius: on hard, level ground, without slip.
  1. Mark the ground under a wheel's hub. Drive straight for at least 5 m, slowly; stop.
  2. Measure the distance with a tape; give it to the command with its standard deviation.
  3. Repeat in the other direction."""


@dataclass(frozen=True, slots=True)
class LoadCellFit:
    """Load = `span` × (reading − `zero_N`), with standard deviations."""

    zero_N: float
    zero_std_N: float
    span: float
    span_std: float

    def line(self, known_N: Array) -> Array:
        """Return the reading at a known load [N]."""
        return self.zero_N + known_N / self.span


@dataclass(frozen=True, slots=True)
class NoLoadFit:
    """No-load current I_0 = sign(ω) (`coulomb_A` + `viscous_A_s_per_rad` |ω|), with standard deviations."""

    coulomb_A: float
    coulomb_std_A: float
    viscous_A_s_per_rad: float
    viscous_std_A_s_per_rad: float

    def line(self, motor_speed_rad_s: Array) -> Array:
        """Return the no-load current at a motor speed [A]."""
        return np.sign(motor_speed_rad_s) * self.coulomb_A + self.viscous_A_s_per_rad * motor_speed_rad_s


@dataclass(frozen=True, slots=True)
class RadiusFit:
    """Rolling radius of a wheel, with its standard deviation."""

    radius_m: float
    radius_std_m: float


def fit_load_cell(weight_kg: Array, reading_N: Array) -> LoadCellFit:
    """Fit zero and span of a load cell to its readings under known weights.

    Parameters
    ----------
    weight_kg
        Weight on the cell [kg], shape (samples,); a run of equal weights is one step.
    reading_N
        Reading of the cell [N], same shape.

    Raises
    ------
    BenchError
        There are fewer than three steps, or the readings decrease with the weight.
    """
    line = fit_line(weight_kg * GRAVITY_M_S2, reading_N, _equal_runs(weight_kg))
    if line.slope <= 0:
        raise BenchError(
            "the readings decrease as the weight increases: the polarity of the cell, or of the column, is reversed"
        )
    return LoadCellFit(line.offset, line.offset_std, 1 / line.slope, line.slope_std / line.slope**2)


def fit_no_load_current(motor_speed_rad_s: Array, motor_current_A: Array, settle: float = 0.05) -> NoLoadFit:
    """Fit Coulomb and viscous no-load current to a spin of one wheel off the ground.

    Parameters
    ----------
    motor_speed_rad_s, motor_current_A
        Speed [rad/s] and current [A] of the motor, shape (samples,).
    settle
        Samples whose speed changes by more than this share are accelerating and are left out, as are those below
        1 rad/s.

    Raises
    ------
    BenchError
        There are fewer than three steady speeds, or the Coulomb current is significantly negative.
    """
    speed = np.abs(motor_speed_rad_s)
    change = np.abs(np.gradient(motor_speed_rad_s))
    steady = (speed > 1.0) & (change < settle * speed)
    if not steady.any():
        raise BenchError("the wheel never turned at a steady speed")
    along = motor_current_A[steady] * np.sign(motor_speed_rad_s[steady])
    line = fit_line(speed[steady], along, _speed_steps(motor_speed_rad_s[steady]))
    if line.offset < -3 * line.offset_std:
        raise BenchError(
            "the current extrapolated to standstill is negative: check that the wheels are off the ground, and warm"
        )
    if line.slope < 0:
        # Viscous friction is not negative: within its error the current does not depend on the speed.
        line = LineFit(
            line.offset + line.slope * float(speed[steady].mean()), line.residual_std, 0.0, line.slope_std, 0.0
        )
    return NoLoadFit(max(line.offset, 0.0), line.offset_std, line.slope, line.slope_std)


def fit_brake(brake_torque_Nm: Array, motor_current_A: Array, gain_Nm_per_A: float) -> EfficiencyFit:
    """Fit one wheel's efficiency against torque; a run of equal brake torques is one step (see `fit_efficiency`)."""
    return fit_efficiency(np.abs(brake_torque_Nm), np.abs(motor_current_A), _equal_runs(brake_torque_Nm), gain_Nm_per_A)


def fit_radius(
    time_s: Array,
    motor_speed_rad_s: Array,
    ratio: float,
    distance_m: float,
    distance_std_m: float,
    counts_std: float = 0.0,
) -> RadiusFit:
    """Return the radius of a wheel that rolled a distance: r = d / ∫ω dt, with ω at the wheel, by the trapezoidal rule.

    Parameters
    ----------
    time_s, motor_speed_rad_s
        Time [s] and speed of the motor [rad/s], shape (samples,); start and stop of the motion included.
    ratio
        Motor turns per wheel turn [1].
    distance_m, distance_std_m
        Measured distance and its standard deviation [m].
    counts_std
        Standard deviation of the wheel's angle by the encoder [rad].

    Raises
    ------
    BenchError
        The wheel turned less than once.
    """
    turned = abs(float(np.trapezoid(motor_speed_rad_s, time_s))) / ratio
    if turned < 2 * np.pi:
        raise BenchError(f"the wheel turned {turned / (2 * np.pi):.2f} times: drive at least one whole turn")
    value = distance_m / turned
    # Start and end of the motion are known to one sampling interval each, uniformly distributed.
    sampling_std = float(np.median(np.diff(time_s)) * np.max(np.abs(motor_speed_rad_s))) / ratio / np.sqrt(6)
    relative = np.hypot(distance_std_m / distance_m, np.hypot(sampling_std, counts_std) / turned)
    return RadiusFit(value, float(value * relative))


def _equal_runs(level: Array) -> Array:
    """Return the numbers of the runs of equal values: a weight that is put on twice makes two steps."""
    return np.concatenate([[0.0], np.cumsum(np.diff(level) != 0)])


def _speed_steps(speed: Array) -> Array:
    """Return the numbers of the steps of speed: a new one wherever the speed changes by more than a tenth."""
    jump = np.abs(np.diff(speed)) > 0.1 * np.maximum(np.abs(speed[1:]), np.abs(speed[:-1]))
    return np.concatenate([[0.0], np.cumsum(jump)])
