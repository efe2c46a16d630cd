"""An electric oven: one thermal mass with a heater, whose temperature and current are recorded; its user has an FMU."""

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
from regolithd.calibration.validation.machine_trials.physics.signals import between, stairs

if TYPE_CHECKING:
    from numpy.random import Generator

TEMPERATURE, CURRENT = "oven_temperature_degC", "heater_current_A"
VOLTAGE, AMBIENT = "heater_voltage_V", "ambient_temperature_degC"
STEFAN_BOLTZMANN_W_M2_K4 = 5.670374419e-8
ZERO_DEGC_K = 273.15


def drive(rng: Generator, schedule: Schedule) -> Drive:
    """Step the heater's voltage, from an oven at 20 °C."""
    t_s = schedule.times_s
    columns = {
        VOLTAGE: stairs(rng, t_s, lambda r: r.choice([0, 1, 1, 1]) * r.uniform(40, 125), (200, 1500))[:, None],
        AMBIENT: between(rng, t_s, 14.0, 26.0)[:, None],
    }
    return Drive(t_s, columns, np.ones((len(t_s), 1), dtype=bool))


def respond(drive: Drive, values: Values, inside: Inside) -> Readings:
    """Return the oven's temperature [°C] and the heater's current [A]: exact steps of the linear heat balance.

    The heat that radiates, which only a concealed effect has, is held over a step.
    """
    rows = len(drive.t_s)
    volts, ambient = drive.columns[VOLTAGE][:, 0], drive.columns[AMBIENT][:, 0]
    loss = values["loss_W_K"] * (1 + np.asarray(inside.get("opened", 0.0)) * np.ones(rows))
    black_m2 = float(inside.get("radiating_m2", 0.0))
    power = volts**2 / values["heater_ohm"]
    keeps = np.exp(-loss * drive.step_s / values["heat_capacity_J_K"])
    celsius, now = np.zeros(rows), 20.0
    for row in range(rows):
        celsius[row] = now
        kelvin, around = now + ZERO_DEGC_K, float(ambient[row]) + ZERO_DEGC_K
        heat = float(power[row]) - black_m2 * STEFAN_BOLTZMANN_W_M2_K4 * (kelvin**4 - around**4)
        settles = float(ambient[row]) + heat / float(loss[row])
        now = settles + (now - settles) * float(keeps[row])
    return {TEMPERATURE: celsius[:, None], CURRENT: (volts / values["heater_ohm"])[:, None]}


def radiation(_: Generator, world: World) -> Effect:
    """Heat lost with the fourth power of the temperature (Stefan and Boltzmann)."""
    return Effect(
        None,
        "radiation",
        TEMPERATURE,
        "temperature",
        world.machine.every_axis,
        inside=lambda size: {"radiating_m2": size},
        largest=1.0,
    )


def opened_door(rng: Generator, world: World) -> Effect:
    """Open the door in three spells."""
    on = effects.spells(rng, world)
    return Effect(
        None,
        "opened-door",
        TEMPERATURE,
        "time",
        world.machine.every_axis,
        inside=lambda size: {"opened": size * on},
        largest=20.0,
    )


def hot_wire(_: Generator, world: World) -> Effect:
    """Let the heater wire's resistance grow as it glows: the current sags at high voltage."""
    volts = world.drive.columns[VOLTAGE]
    return effects.unnamed("glowing-wire", CURRENT, VOLTAGE, -(np.clip(volts - 60, 0, None) ** 2), world)


OVEN = Machine(
    name="oven",
    axes=("1",),
    axis_column="",
    channels={TEMPERATURE: "°C", CURRENT: "A"},
    parameters={
        "heat_capacity_J_K": Known(6000.0, 240.0, "J/K"),
        "loss_W_K": Known(4.0, 0.16, "W/K"),
        "heater_ohm": Known(20.0, 0.5, "Ω"),
    },
    schedules=(Schedule(1, 10800), Schedule(1, 18000), Schedule(1, 14400)),
    drive=drive,
    respond=respond,
    effects={"sensor-delay": effects.late(TEMPERATURE, 900.0), "current-sensor-bias": effects.current_bias(CURRENT)},
    outside={"radiation": radiation, "opened-door": opened_door, "glowing-wire": hot_wire},
    lasting=("sensor-delay", "current-sensor-bias"),
    slow_column=AMBIENT,
    blank_column=CURRENT,
    base_units=Units({"temperature_variable": "T_degC", "temperature": TEMPERATURE, "current": CURRENT}),
    other_units=Units(
        {"temperature_variable": "T_K", "temperature": "oven_temperature_K", "current": CURRENT},
        ((TEMPERATURE, "oven_temperature_K", 1.0, ZERO_DEGC_K),),
    ),
)
