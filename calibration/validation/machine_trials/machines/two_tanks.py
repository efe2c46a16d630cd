"""Two tanks on load cells, the first draining into the second: stateful, nonlinear in its parameters, in two runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import constants

from regolithd.calibration.validation.machine_trials.physics import effects
from regolithd.calibration.validation.machine_trials.physics.machine import (
    Array,
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
from regolithd.calibration.validation.machine_trials.physics.signals import between, stairs, wander

if TYPE_CHECKING:
    from numpy.random import Generator

GRAVITY_M_S2 = constants.g
LOAD, VOLTAGE, TEMPERATURE = "load_N", "pump_voltage_V", "water_temperature_degC"
AREA_M2, DENSITY_KG_M3 = 0.02, 998.0
BETWEEN_RUNS_S = 900.0
HOLE_M = 0.15


def drive(rng: Generator, schedule: Schedule) -> Drive:
    """Pump at changing voltages, in two runs that both begin with empty tanks."""
    t_s = schedule.times_s
    half = len(t_s) // 2
    run = np.where(np.arange(len(t_s)) < half, 1, 2)
    volts = stairs(rng, t_s, lambda r: r.uniform(3, 11), (60, 500))
    celsius = between(rng, t_s, 8.0, 25.0)
    columns = {VOLTAGE: np.stack([volts, volts], axis=1), TEMPERATURE: np.stack([celsius, celsius], axis=1)}
    return Drive(t_s + BETWEEN_RUNS_S * (run == 2), columns, np.ones((len(t_s), 2), dtype=bool), run)


def respond(drive: Drive, values: Values, inside: Inside) -> Readings:
    """Return the weight of the water in each tank [N]."""
    runs = drive.run if drive.run is not None else np.ones(len(drive.t_s))
    parts = [filled(drive, values, inside, np.flatnonzero(runs == run)) for run in np.unique(runs)]
    return {LOAD: DENSITY_KG_M3 * GRAVITY_M_S2 * AREA_M2 * np.concatenate(parts)}


def filled(drive: Drive, values: Values, inside: Inside, rows: np.ndarray) -> Array:
    """Return the levels [m] of one run from empty: the classical fourth-order Runge–Kutta method, one step a row.

    A tank drains by Torricelli's law with an effective area; below 1 mm the outflow falls linearly, so that the law has
    a slope at rest.
    """
    opening = np.asarray(inside.get("first_opening", 1.0)) * np.ones(len(drive.t_s))
    hole, weak = float(inside.get("hole_m2", 0.0)), float(inside.get("pump_loss", 0.0))
    volts = drive.columns[VOLTAGE][:, 0]
    pumped = values["pump_gain_m3_s_V"] * (volts - weak * np.clip(volts - 7.0, 0, None))
    first = values["first_outlet_m2"] * opening
    second, step = values["second_outlet_m2"], drive.step_s

    def speed(level: float) -> float:
        head = max(level, 0.0)
        return float(np.sqrt(2 * GRAVITY_M_S2)) * (head**0.5 if head > 1e-3 else head / 1e-3**0.5)

    def rates(flow: float, outlet: float, one: float, two: float) -> tuple[float, float]:
        down = outlet * speed(one)
        return (flow - down) / AREA_M2, (down - second * speed(two) - hole * speed(two - HOLE_M)) / AREA_M2

    levels, one, two = np.zeros((len(rows), 2)), 0.0, 0.0
    for at, row in enumerate(rows):
        levels[at] = one, two
        flow, outlet = float(pumped[row]), float(first[row])
        a = rates(flow, outlet, one, two)
        b = rates(flow, outlet, one + step / 2 * a[0], two + step / 2 * a[1])
        c = rates(flow, outlet, one + step / 2 * b[0], two + step / 2 * b[1])
        d = rates(flow, outlet, one + step * c[0], two + step * c[1])
        one += step / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
        two += step / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
    return levels


def drift(rng: Generator, world: World) -> Effect:
    """One load cell that creeps away from an onset on, wandering a little."""
    axes, onset = effects.one_axis(rng, world), effects.later(rng, world, 0.15, 0.55)
    t_s = world.drive.t_s
    part = np.clip((t_s - onset) / (t_s[-1] - onset), 0, 1)
    path = part * (1 + 0.15 * wander(rng, t_s, np.ptp(t_s) / 12)) * rng.choice([-1.0, 1.0])
    shape = path[:, None] * effects.spread(axes, world)
    name, largest = "load-cell-drift", 5 * world.mean_size(LOAD)
    return Effect(name, name, LOAD, "time", axes, added=lambda size: size * shape, onset_s=onset, largest=largest)


def hole(_: Generator, world: World) -> Effect:
    """Drill a hole into the wall of the second tank, 15 cm above its bottom."""
    largest = 3 * world.values["second_outlet_m2"]
    return Effect(None, "hole-in-the-wall", LOAD, "load", (1,), inside=lambda size: {"hole_m2": size}, largest=largest)


def clogging(rng: Generator, world: World) -> Effect:
    """Clog the first tank's outlet from some time on."""
    onset, t_s = effects.later(rng, world), world.drive.t_s
    gone = 1 - np.exp(-np.clip(t_s - onset, 0, None) / (0.1 * np.ptp(t_s)))
    every = world.machine.every_axis
    return Effect(
        None,
        "clogging",
        LOAD,
        "time",
        every,
        inside=lambda size: {"first_opening": 1 - size * gone},
        onset_s=onset,
        largest=0.5,
    )


def tired_pump(_: Generator, world: World) -> Effect:
    """Let the pump cavitate: above 7 V it delivers less than its gain says."""
    every = world.machine.every_axis
    return Effect(None, "cavitation", LOAD, "voltage", every, inside=lambda size: {"pump_loss": size}, largest=0.9)


def words(time: str, load: str, unit: str, per_N: str) -> dict[str, str]:
    """Return what the first simulation's text has in place of its units."""
    to_s = "60.0" if time == "t_min" else "1.0"
    return {"time": time, "seconds": to_s, "load": load, "unit": unit, "per_N": per_N}


TWO_TANKS = Machine(
    name="two-tanks",
    axes=("first", "second"),
    axis_column="tank",
    channels={LOAD: "N"},
    parameters={
        "pump_gain_m3_s_V": Known(1.0e-5, 5e-7, "m³/(s V)"),
        "first_outlet_m2": Known(3.0e-5, 1.2e-6, "m²"),
        "second_outlet_m2": Known(3.3e-5, 1.3e-6, "m²"),
    },
    schedules=(Schedule(1, 14400), Schedule(1, 10800), Schedule(2, 7200)),
    drive=drive,
    respond=respond,
    effects={"load-cell-drift": drift, "sensor-delay": effects.late(LOAD, 300.0)},
    outside={"hole-in-the-wall": hole, "clogging": clogging, "cavitation": tired_pump},
    lasting=("sensor-delay",),
    slow_column=LOAD,
    blank_column=LOAD,
    base_units=Units(words("t_s", LOAD, "N", "1.0")),
    other_units=Units(
        words("t_min", "load_kN", "kN", "0.001"), (("t_s", "t_min", 1 / 60, 0.0), (LOAD, "load_kN", 0.001, 0.0))
    ),
)
