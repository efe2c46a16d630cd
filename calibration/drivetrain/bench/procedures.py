"""The four procedures: load cells by known weights, a wheels-up spin, a brake, and a measured distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.drivetrain.bench.efficiency import Efficiency, fit_efficiency
from regolithd.calibration.drivetrain.bench.line import BenchError, Line, fit_line
from regolithd.calibration.parameters import GRAVITY_M_S2

Array = NDArray[np.float64]

LOAD_CELLS = """\
Load cells: zero and span of one wheel's cell.
  1. Lift the wheel off the ground and record ten seconds: 0 kg.
  2. Put known weights on the cell, at least two more of them, up to about 8 kg; ten seconds each.
  3. Take them off in the other order, so that hysteresis shows.
The recording's column `weight_kg` says what was on at each instant; rows without it are left out."""

WHEELS_UP = """\
Wheels up: what the drivetrain takes by itself.
  1. Put the rover on a stand, all wheels free. Let it run for ten minutes: grease is stiff when cold.
  2. Drive at five speeds or more, forward and backward, twenty seconds each, from a fifth of the speed you drive at to
     the most it can.
  3. Note the temperature: the result holds for it."""

BRAKE = """\
Brake: the gears' efficiency against the torque they carry, for one wheel.
  1. Wheels up. Put a brake with a balance on the wheel.
  2. At your driving speed, brake with five torques or more, from none to about 2 N m, up and down again; twenty
     seconds each.
The recording's column `brake_torque_Nm` says what the balance showed; rows without it are left out."""

RADIUS = """\
Wheel radius: on hard, level ground, where nothing slips.
  1. Mark the ground under a wheel's hub. Drive straight for at least 5 m, slowly; stop.
  2. Measure the distance with a tape, and tell it to the command with its uncertainty.
  3. Once more in the other direction."""


@dataclass(frozen=True, slots=True)
class LoadCell:
    """load = `span` × (reading − `zero_N`)."""

    zero_N: float
    zero_std_N: float
    span: float
    span_std: float

    def line(self, known_N: Array) -> Array:
        """Return the reading that a load gives [N]."""
        return self.zero_N + known_N / self.span


@dataclass(frozen=True, slots=True)
class NoLoad:
    """Current = sign(ω) (`coulomb_A` + `viscous_A_s_per_rad` |ω|)."""

    coulomb_A: float
    coulomb_std_A: float
    viscous_A_s_per_rad: float
    viscous_std_A_s_per_rad: float

    def line(self, motor_speed_rad_s: Array) -> Array:
        """Return the current that a speed takes [A]."""
        return np.sign(motor_speed_rad_s) * self.coulomb_A + self.viscous_A_s_per_rad * motor_speed_rad_s


@dataclass(frozen=True, slots=True)
class Radius:
    """A wheel's rolling radius."""

    radius_m: float
    radius_std_m: float


def load_cell(weight_kg: Array, reading_N: Array) -> LoadCell:
    """Return zero and span of a load cell from its readings under known weights."""
    line = fit_line(weight_kg * GRAVITY_M_S2, reading_N, _runs(weight_kg))
    if line.slope <= 0:
        raise BenchError("readings fall as the weight grows: the cell is wired the wrong way round, or the column is")
    return LoadCell(line.offset, line.offset_std, 1 / line.slope, line.slope_std / line.slope**2)


def wheels_up(motor_speed_rad_s: Array, motor_current_A: Array, settle: float = 0.05) -> NoLoad:
    """Return Coulomb and viscous current from a spin of one wheel off the ground.

    Instants at which the speed differs from its neighbours' by more than `settle` of itself are accelerating, and are
    left out; so is standstill.
    """
    speed = np.abs(motor_speed_rad_s)
    change = np.abs(np.gradient(motor_speed_rad_s))
    steady = (speed > 1.0) & (change < settle * speed)
    if not steady.any():
        raise BenchError("the wheel never turned at a steady speed")
    along = motor_current_A[steady] * np.sign(motor_speed_rad_s[steady])
    line = fit_line(speed[steady], along, _levels(motor_speed_rad_s[steady]))
    if line.offset < -3 * line.offset_std:
        raise BenchError("the current at no speed comes out below zero: were the wheels off the ground, and warm?")
    if line.slope < 0:
        # Drag does not fall with speed; within its error it does not depend on it.
        line = Line(line.offset + line.slope * float(speed[steady].mean()), line.residual_std, 0.0, line.slope_std, 0.0)
    return NoLoad(max(line.offset, 0.0), line.offset_std, line.slope, line.slope_std)


def brake(brake_torque_Nm: Array, motor_current_A: Array, gain_Nm_per_A: float) -> Efficiency:
    """Return one wheel's efficiency against torque from the torques of a brake."""
    return fit_efficiency(np.abs(brake_torque_Nm), np.abs(motor_current_A), _runs(brake_torque_Nm), gain_Nm_per_A)


def radius(
    time_s: Array,
    motor_speed_rad_s: Array,
    ratio: float,
    distance_m: float,
    distance_std_m: float,
    counts_std: float = 0.0,
) -> Radius:
    """Return a wheel's radius from a distance: r = d / ∫ω dt, with ω at the wheel, by the trapezoidal rule."""
    turned = abs(float(np.trapezoid(motor_speed_rad_s, time_s))) / ratio
    if turned < 2 * np.pi:
        raise BenchError(f"the wheel turned {turned / (2 * np.pi):.2f} times: drive at least one whole turn")
    value = distance_m / turned
    # Between the first sample and the start of the motion, and likewise at its end, half an interval is unknown.
    lost = float(np.median(np.diff(time_s)) * np.max(np.abs(motor_speed_rad_s))) / ratio / np.sqrt(6)
    relative = np.hypot(distance_std_m / distance_m, np.hypot(lost, counts_std) / turned)
    return Radius(value, float(value * relative))


def _runs(level: Array) -> Array:
    """Return a number for each run of one level: a weight put on twice is two steps."""
    return np.concatenate([[0.0], np.cumsum(np.diff(level) != 0)])


def _levels(speed: Array) -> Array:
    """Return a number for each set speed: a step wherever the speed jumps by more than a tenth."""
    jump = np.abs(np.diff(speed)) > 0.1 * np.maximum(np.abs(speed[1:]), np.abs(speed[:-1]))
    return np.concatenate([[0.0], np.cumsum(jump)])
