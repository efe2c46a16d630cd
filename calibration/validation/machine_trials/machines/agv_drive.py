"""The two wheel drives of an automated guided vehicle in a warehouse: static, with many covariates."""

from __future__ import annotations

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
from regolithd.calibration.validation.machine_trials.physics.signals import between, moves, stairs

if TYPE_CHECKING:
    from numpy.random import Generator

GRAVITY_M_S2 = constants.g
CURRENT, SPEED, ACCELERATION = "motor_current_A", "wheel_speed_rad_s", "wheel_acceleration_rad_s2"
ANGLE, PAYLOAD, PITCH, YAW_RATE = "wheel_angle_rad", "payload_kg", "pitch_rad", "yaw_rate_rad_s"
TEMPERATURE, VOLTAGE = "motor_temperature_degC", "bus_voltage_V"
RADIUS_M, TRACK_M, TORQUE_NM_PER_A = 0.1, 0.5, 2.0
SIDE = np.array([-1.0, 1.0])
SMOOTH_RAD_S, STANDING_RAD_S = 0.03, 0.15


def speed_level(rng: Generator) -> float:
    """Return a wheel speed [rad/s]: now and then none, mostly forwards."""
    return 0.0 if rng.uniform() < 0.12 else float(rng.uniform(1, 8) * rng.choice([1, 1, -1]))


def drive(rng: Generator, schedule: Schedule) -> Drive:
    """Drive, turn, reverse and stop, with changing payload, up and down ramps."""
    t_s = schedule.times_s
    middle, ahead, _ = moves(rng, t_s, speed_level, (0.8, 3), (1, 12))
    yaw, turn, _ = moves(rng, t_s, lambda r: r.choice([0, 0, 1]) * r.uniform(-0.8, 0.8), (0.8, 2), (1, 6))
    lever = SIDE * TRACK_M / 2 / RADIUS_M
    speed = middle[:, None] + yaw[:, None] * lever
    columns = {
        SPEED: speed,
        ACCELERATION: ahead[:, None] + turn[:, None] * lever,
        ANGLE: np.cumsum(speed, axis=0) / schedule.rate_Hz,
        PAYLOAD: stairs(rng, t_s, lambda r: r.uniform(0, 150), (15, 90))[:, None] * np.ones(2),
        PITCH: 0.03 * np.tanh(np.stack([moves(rng, t_s, lambda r: r.normal(), (1, 4), (2, 12))[0]] * 2, axis=1)),
        YAW_RATE: np.stack([yaw, yaw], axis=1),
        TEMPERATURE: np.stack([between(rng, t_s, rng.uniform(-12, -2), rng.uniform(42, 55)) for _ in SIDE], axis=1),
        VOLTAGE: np.stack([between(rng, t_s, 23.0, 28.5, 10)] * 2, axis=1),
    }
    return Drive(t_s, columns, np.abs(speed) > STANDING_RAD_S)


def respond(drive: Drive, values: Values, _: Inside) -> Readings:
    """Return the current that rolls half the vehicle's weight on each side [A]."""
    weight = (values["empty_mass_kg"] + drive.columns[PAYLOAD]) * GRAVITY_M_S2 / 2
    torque = values["rolling_coefficient"] * weight * RADIUS_M * np.sign(drive.columns[SPEED])
    return {CURRENT: torque / TORQUE_NM_PER_A}


def scrub(_: Generator, world: World) -> Effect:
    """Scrub in a turn: the outer wheel pushes and the inner one holds back, soon saturated."""
    shape = SIDE * np.tanh(world.drive.columns[YAW_RATE] / 0.08)
    name, largest = "turning-resistance", 5 * world.mean_size(CURRENT)
    axes = world.machine.every_axis
    return Effect(
        name, name, CURRENT, "yaw_rate", axes, added=lambda size: size * shape, largest=largest, needs=(YAW_RATE,)
    )


def cogged_tyre(rng: Generator, world: World) -> Effect:
    """Add a tread that is periodic in the wheel's angle, with a weaker second harmonic."""
    order, phase = int(rng.integers(3, 7)), rng.uniform(0, 2 * np.pi, 2)
    turned = order * world.drive.columns[ANGLE]
    shape = np.sin(turned + phase[0]) + 0.25 * np.sin(2 * turned + phase[1])
    name, axes, largest = "wheel-angle-ripple", world.machine.every_axis, 5 * world.mean_size(CURRENT)
    return Effect(
        name,
        name,
        CURRENT,
        "wheel_angle",
        axes,
        added=lambda size: size * shape,
        largest=largest,
        parameters=lambda _: {"order": float(order)},
    )


def converter_loss(rng: Generator, world: World) -> Effect:
    """Let the converter's loss follow the bus voltage."""
    volts = world.drive.columns[VOLTAGE] - 25.7
    shape = np.tanh(world.drive.columns[SPEED] / SMOOTH_RAD_S) * np.tanh(volts / rng.uniform(0.8, 2))
    return effects.unnamed("converter-loss", CURRENT, "voltage", shape, world)


def soft_tyre(_: Generator, world: World) -> Effect:
    """Let the tyre sag once the payload passes its rating: loss above 110 kg alone."""
    over = np.clip(world.drive.columns[PAYLOAD] - 110.0, 0, None)
    return effects.unnamed("sagging-tyre", CURRENT, "load", np.tanh(world.drive.columns[SPEED] / 0.03) * over, world)


def resonance(rng: Generator, world: World) -> Effect:
    """Shake the frame at one speed, where it then costs current."""
    speed = world.drive.columns[SPEED]
    off = (np.abs(speed) - rng.uniform(3, 5)) / rng.uniform(0.3, 0.5)
    return effects.unnamed("resonance", CURRENT, "wheel_speed", np.tanh(speed / 0.03) * np.exp(-(off**2) / 2), world)


def words(current: str, unit: str, per_A: str, temperature: str, time: str) -> dict[str, str]:
    """Return what the first simulation's text has in place of its units."""
    return {"current": current, "unit": unit, "per_A": per_A, "temperature": temperature, "time": time}


AGV_DRIVE = Machine(
    name="agv-drive",
    axes=("left", "right"),
    axis_column="side",
    channels={CURRENT: "A"},
    parameters={"rolling_coefficient": Known(0.015, 0.0006, ""), "empty_mass_kg": Known(80.0, 2.0, "kg")},
    schedules=(Schedule(10, 1500), Schedule(20, 900), Schedule(5, 2400)),
    drive=drive,
    respond=respond,
    effects={
        "coulomb-friction": effects.coulomb(CURRENT, SPEED, SMOOTH_RAD_S, "coulomb_current"),
        "viscous-friction": effects.proportional("viscous-friction", CURRENT, SPEED, "wheel_speed"),
        "quadratic-drag": effects.quadratic(CURRENT, SPEED, SMOOTH_RAD_S, 8.0),
        "cold-lubricant-friction": effects.cold_lubricant(CURRENT, SPEED, SMOOTH_RAD_S, TEMPERATURE),
        "rotor-inertia": effects.proportional("rotor-inertia", CURRENT, ACCELERATION, "wheel_acceleration"),
        "grade-resistance": effects.proportional("grade-resistance", CURRENT, PITCH, "pitch"),
        "turning-resistance": scrub,
        "wheel-angle-ripple": cogged_tyre,
        "bearing-drag": effects.bearing(CURRENT, SPEED, SMOOTH_RAD_S),
        "current-sensor-bias": effects.current_bias(CURRENT),
        "sensor-delay": effects.late(CURRENT, 2.0),
    },
    rivals={
        "stribeck-friction": effects.stribeck(CURRENT, SPEED, SMOOTH_RAD_S, (0.5, 1.5)),
        "torque-constant-temperature": effects.magnet_temperature(CURRENT, TEMPERATURE),
        "load-dependent-efficiency": effects.gear_losses(CURRENT, SPEED, SMOOTH_RAD_S),
    },
    outside={
        "converter-loss": converter_loss,
        "sagging-tyre": soft_tyre,
        "resonance": resonance,
        "caught-in-spells": effects.caught(CURRENT, SPEED, SMOOTH_RAD_S),
    },
    lasting=("viscous-friction", "rotor-inertia", "grade-resistance", "turning-resistance"),
    parameters_have_no_double=False,  # rolling coefficient: load-dependent losses; mass: Coulomb friction
    slow_column=TEMPERATURE,
    blank_column=YAW_RATE,
    base_units=Units(words(CURRENT, "A", "1.0", TEMPERATURE, "t_s")),
    other_units=Units(
        words("motor_current_mA", "mA", "1000.0", "motor_temperature_degF", "t_min"),
        (
            (CURRENT, "motor_current_mA", 1000.0, 0.0),
            (TEMPERATURE, "motor_temperature_degF", 1.8, 32.0),
            ("t_s", "t_min", 1 / 60, 0.0),
        ),
    ),
)
