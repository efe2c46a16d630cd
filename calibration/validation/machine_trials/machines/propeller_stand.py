"""A propeller on a test stand: thrust and torque at once, in two units; the rotor turns both ways."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

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
from regolithd.calibration.validation.machine_trials.physics.signals import between, moves, stairs

if TYPE_CHECKING:
    from numpy.random import Generator

THRUST, TORQUE, SPEED, ACCELERATION = "thrust_N", "torque_Nm", "rotor_speed_rad_s", "rotor_acceleration_rad_s2"
TEMPERATURE, HEIGHT, VOLTAGE = "bearing_temperature_degC", "height_m", "supply_voltage_V"
SMOOTH_RAD_S = 4.0
DIAMETER_M = 0.25


def speed_level(rng: Generator) -> float:
    """Return a rotor speed [rad/s], backwards one time in three."""
    return float(rng.uniform(120, 800) * rng.choice([1, 1, -1]))


def drive(rng: Generator, schedule: Schedule) -> Drive:
    """Run through speeds both ways, at several heights over a plate; the bearing warms and cools."""
    t_s = schedule.times_s
    speed, acceleration, _ = moves(rng, t_s, speed_level, (0.3, 1.2), (0.2, 2.5))
    columns = {
        SPEED: speed[:, None],
        ACCELERATION: acceleration[:, None],
        TEMPERATURE: between(rng, t_s, rng.uniform(-12, -2), rng.uniform(42, 55))[:, None],
        HEIGHT: stairs(rng, t_s, lambda r: 0.06 * 10 ** r.uniform(0, 1), (4, 15))[:, None],
        VOLTAGE: between(rng, t_s, 14.0, 16.8, 9)[:, None],
    }
    return Drive(t_s, columns, np.ones((len(t_s), 1), dtype=bool))


def respond(drive: Drive, values: Values, _: Inside) -> Readings:
    """Return thrust [N] and torque [N·m], each with the square of the speed and its sign."""
    square = drive.columns[SPEED] * np.abs(drive.columns[SPEED])
    return {
        THRUST: values["thrust_coefficient_N_s2"] * square,
        TORQUE: values["torque_coefficient_Nm_s2"] * square,
    }


def ground_effect(_: Generator, world: World) -> Effect:
    """Thrust gained near a plate: Cheeseman and Bennett's 1 / (1 − (R / 4 z)²), forwards and backwards alike."""
    over = (DIAMETER_M / 2 / (4 * world.drive.columns[HEIGHT])) ** 2
    shape = world.base[THRUST] * over / (1 - over)
    return effects.unnamed("ground-effect", THRUST, "height", shape, world)


def resonance(rng: Generator, world: World) -> Effect:
    """Shake the stand at one speed, where it then costs torque."""
    speed = world.drive.columns[SPEED]
    off = (np.abs(speed) - rng.uniform(350, 550)) / rng.uniform(30, 50)
    shape = np.tanh(speed / SMOOTH_RAD_S) * np.exp(-(off**2) / 2)
    return effects.unnamed("resonance", TORQUE, "wheel_speed", shape, world)


def supply_hum(rng: Generator, world: World) -> Effect:
    """Torque lost to the supply's ripple, which follows its voltage."""
    shape = np.tanh(world.drive.columns[SPEED] / SMOOTH_RAD_S) * np.tanh(
        (world.drive.columns[VOLTAGE] - 15.4) / rng.uniform(0.4, 0.8)
    )
    return effects.unnamed("supply-ripple", TORQUE, "voltage", shape, world)


def words(torque: str, unit: str, per_Nm: str, temperature: str, height: str) -> dict[str, str]:
    """Return what the first simulation's text has in place of its units."""
    found = {"torque": torque, "unit": unit, "per_Nm": per_Nm}
    return {**found, "temperature": temperature, "height": height, "time": "t_s"}


PROPELLER_STAND = Machine(
    name="propeller-stand",
    axes=("1",),
    axis_column="",
    channels={THRUST: "N", TORQUE: "N·m"},
    parameters={
        "thrust_coefficient_N_s2": Known(1.2e-5, 5e-7, "N s²"),
        "torque_coefficient_Nm_s2": Known(2.0e-7, 8e-9, "N m s²"),
    },
    schedules=(Schedule(100, 240), Schedule(200, 130), Schedule(50, 480)),
    drive=drive,
    respond=respond,
    effects={
        "coulomb-friction": effects.coulomb(TORQUE, SPEED, SMOOTH_RAD_S, "coulomb_torque"),
        "viscous-friction": effects.proportional("viscous-friction", TORQUE, SPEED, "wheel_speed"),
        "rotor-inertia": effects.proportional("rotor-inertia", TORQUE, ACCELERATION, "wheel_acceleration"),
        "cold-lubricant-friction": effects.cold_lubricant(TORQUE, SPEED, SMOOTH_RAD_S, TEMPERATURE),
        "bearing-drag": effects.bearing(TORQUE, SPEED, SMOOTH_RAD_S),
        "sensor-delay": effects.late(THRUST, 0.5),
    },
    rivals={
        "quadratic-drag": effects.quadratic(TORQUE, SPEED, SMOOTH_RAD_S, 800.0),
        "stribeck-friction": effects.stribeck(TORQUE, SPEED, SMOOTH_RAD_S, (60.0, 200.0)),
    },
    outside={
        "ground-effect": ground_effect,
        "resonance": resonance,
        "supply-ripple": supply_hum,
        "caught-in-spells": effects.caught(TORQUE, SPEED, SMOOTH_RAD_S),
    },
    lasting=("coulomb-friction", "viscous-friction", "rotor-inertia", "sensor-delay"),
    parameters_have_no_double=False,  # torque coefficient: quadratic drag
    slow_column=TEMPERATURE,
    blank_column=TEMPERATURE,
    base_units=Units(words(TORQUE, "N·m", "1.0", TEMPERATURE, HEIGHT)),
    other_units=Units(
        words("torque_mNm", "mN·m", "1000.0", "bearing_temperature_degF", "height_mm"),
        (
            (TORQUE, "torque_mNm", 1000.0, 0.0),
            (TEMPERATURE, "bearing_temperature_degF", 1.8, 32.0),
            (HEIGHT, "height_mm", 1000.0, 0.0),
        ),
    ),
)
