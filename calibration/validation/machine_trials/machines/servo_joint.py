"""A robot arm's elbow and wrist: limited travel, gravity, current at the motor; a hard stop is possible."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy import constants

from regolithd.calibration.validation.machine_trials.physics import effects
from regolithd.calibration.validation.machine_trials.physics.machine import (
    Drive,
    Effect,
    Inside,
    Known,
    Machine,
    Readings,
    Schedule,
    Units,
    Values,
    World,
)
from regolithd.calibration.validation.machine_trials.physics.signals import between, moves

if TYPE_CHECKING:
    from numpy.random import Generator

GRAVITY_M_S2 = constants.g
CURRENT, ANGLE, SPEED = "motor_current_A", "joint_angle_rad", "joint_speed_rad_s"
ACCELERATION, TEMPERATURE = "joint_acceleration_rad_s2", "motor_temperature_degC"
LENGTH_M = np.array([0.35, 0.20])
TORQUE_NM_PER_A = np.array([12.0, 6.0])
TRAVEL_RAD = np.array([1.3, 0.9])
SMOOTH_RAD_S = 0.01


def angle_level(most_rad: float, rng: Generator) -> float:
    """Return an angle within the travel [rad]."""
    return float(rng.uniform(-most_rad, most_rad))


def drive(rng: Generator, schedule: Schedule) -> Drive:
    """Move both joints between random angles, with rests; the motors warm and cool."""
    t_s = schedule.times_s
    paths = [moves(rng, t_s, partial(angle_level, most), (0.35, 1.8), (0.0, 0.5)) for most in TRAVEL_RAD]
    angle, speed, acceleration = (np.column_stack([path[i] for path in paths]) for i in range(3))
    celsius = np.column_stack([between(rng, t_s, rng.uniform(-12, -2), rng.uniform(42, 55)) for _ in paths])
    columns = {ANGLE: angle, SPEED: speed, ACCELERATION: acceleration, TEMPERATURE: celsius}
    return Drive(t_s, columns, np.ones(angle.shape, dtype=bool))


def respond(drive: Drive, values: Values, _: Inside) -> Readings:
    """Return the current that carries and accelerates a point mass at the arm's end [A]."""
    mass = np.array([values["elbow_mass_kg"], values["wrist_mass_kg"]])
    weight = mass * GRAVITY_M_S2 * LENGTH_M * np.sin(drive.columns[ANGLE] + 0.6)
    inertia = mass * LENGTH_M**2 * drive.columns[ACCELERATION]
    return {CURRENT: (weight + inertia) / TORQUE_NM_PER_A}


def hard_stop(rng: Generator, world: World) -> Effect:
    """One joint that runs into a rubber stop at the end of its travel: stiffening, with loss on the way in."""
    axes = effects.one_axis(rng, world)
    angle = world.drive.columns[ANGLE]
    at = np.quantile(angle[:, axes[0]], rng.uniform(0.90, 0.95))
    into = np.clip(angle - at, 0, None)
    shape = into * (1 + 3 * into) * (1 + 0.2 * np.tanh(world.drive.columns[SPEED] / 0.05))
    return effects.unnamed("hard-stop", CURRENT, "position", shape, world, axes)


def cable_spring(rng: Generator, world: World) -> Effect:
    """Add a cable loom that stiffens towards both ends of one joint's travel."""
    axes = effects.one_axis(rng, world)
    return effects.unnamed("cable-spring", CURRENT, "position", world.drive.columns[ANGLE] ** 3, world, axes)


def grease_band(rng: Generator, world: World) -> Effect:
    """Grease that is stiff in one band of temperature and nowhere else."""
    off = (world.drive.columns[TEMPERATURE] - rng.uniform(12, 28)) / rng.uniform(4, 6)
    shape = np.tanh(world.drive.columns[SPEED] / SMOOTH_RAD_S) * np.exp(-(off**2) / 2)
    return effects.unnamed("grease-band", CURRENT, "temperature", shape, world)


def words(current: str, unit: str, per_A: str, temperature: str) -> dict[str, str]:
    """Return what the first simulation's text has in place of its units."""
    return {"current": current, "unit": unit, "per_A": per_A, "temperature": temperature, "time": "t_s"}


SERVO_JOINT = Machine(
    name="servo-joint",
    axes=("elbow", "wrist"),
    axis_column="axis",
    channels={CURRENT: "A"},
    parameters={"elbow_mass_kg": Known(4.0, 0.16, "kg"), "wrist_mass_kg": Known(1.5, 0.06, "kg")},
    schedules=(Schedule(100, 200), Schedule(200, 120), Schedule(50, 360)),
    drive=drive,
    respond=respond,
    effects={
        "coulomb-friction": effects.coulomb(CURRENT, SPEED, SMOOTH_RAD_S, "coulomb_current"),
        "viscous-friction": effects.proportional("viscous-friction", CURRENT, SPEED, "wheel_speed"),
        "stribeck-friction": effects.stribeck(CURRENT, SPEED, SMOOTH_RAD_S, (0.15, 0.35)),
        "cold-lubricant-friction": effects.cold_lubricant(CURRENT, SPEED, SMOOTH_RAD_S, TEMPERATURE),
        "torque-constant-temperature": effects.magnet_temperature(CURRENT, TEMPERATURE),
        "load-dependent-efficiency": effects.gear_losses(CURRENT, SPEED, SMOOTH_RAD_S),
        "rotor-inertia": effects.proportional("rotor-inertia", CURRENT, ACCELERATION, "wheel_acceleration"),
        "bearing-drag": effects.bearing(CURRENT, SPEED, SMOOTH_RAD_S),
        "current-sensor-bias": effects.current_bias(CURRENT),
        "sensor-delay": effects.late(CURRENT, 0.5),
    },
    rivals={"quadratic-drag": effects.quadratic(CURRENT, SPEED, SMOOTH_RAD_S, 3.0)},
    outside={
        "hard-stop": hard_stop,
        "cable-spring": cable_spring,
        "grease-band": grease_band,
        "caught-in-spells": effects.caught(CURRENT, SPEED, SMOOTH_RAD_S),
    },
    lasting=("coulomb-friction", "viscous-friction", "load-dependent-efficiency", "rotor-inertia"),
    slow_column=TEMPERATURE,
    blank_column=TEMPERATURE,
    base_units=Units(words(CURRENT, "A", "1.0", TEMPERATURE)),
    other_units=Units(
        words("motor_current_mA", "mA", "1000.0", "motor_temperature_K"),
        ((CURRENT, "motor_current_mA", 1000.0, 0.0), (TEMPERATURE, "motor_temperature_K", 1.0, 273.15)),
    ),
)
