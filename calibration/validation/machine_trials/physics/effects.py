"""Concealed effects that several machines share, in forms of textbooks other than a library's obvious ones.

Coulomb friction smoothed by tanh, Stribeck's curve as Tustin has it, Vogel's law for a lubricant, a magnet's remanence
falling with temperature. Each returns the added reading at size 1; `size` is then chosen for the wanted strength.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.validation.machine_trials.physics.machine import Array, Effect, Maker, World

if TYPE_CHECKING:
    from numpy.random import Generator

VOGEL_B_K, VOGEL_T0_DEGC = 700.0, -95.0
"""Vogel's viscosity exp(B / (T − T₀)) of a gear grease; at 60 °C the first simulation's friction covers it."""


def spread(axes: tuple[int, ...], world: World) -> Array:
    """Return 1 for the axes named and 0 for the others."""
    return np.array([float(axis in axes) for axis in world.machine.every_axis])


def one_axis(rng: Generator, world: World) -> tuple[int, ...]:
    """Return one axis."""
    return (int(rng.integers(len(world.machine.axes))),)


def later(rng: Generator, world: World, low: float = 0.25, high: float = 0.65) -> float:
    """Return an onset [s] within the recording."""
    t_s = world.drive.t_s
    return float(t_s[0] + rng.uniform(low, high) * (t_s[-1] - t_s[0]))


def coulomb(channel: str, speed: str, width: float, parameter: str) -> Maker:
    """Constant drag, its sign smoothed by tanh over `width` of speed."""

    def make(_: Generator, world: World) -> Effect:
        shape = np.tanh(world.drive.columns[speed] / width)
        return Effect(
            "coulomb-friction",
            "coulomb-friction",
            channel,
            "direction",
            world.machine.every_axis,
            added=lambda size: size * shape,
            largest=3 * world.mean_size(channel),
            parameters=lambda size: {parameter: size},
        )

    return make


def proportional(name: str, channel: str, column: str, covariate: str) -> Maker:
    """Return an effect proportional to a column: viscous drag to speed, inertia to acceleration, weight to slope."""

    def make(_: Generator, world: World) -> Effect:
        # Not over the recording's own largest value: the same size must be the same physics in a later recording.
        shape = world.drive.columns[column]
        axes = world.machine.every_axis
        largest = 5 * world.mean_size(channel) / float(np.abs(shape).max())
        return Effect(
            name, name, channel, covariate, axes, added=lambda size: size * shape, largest=largest, needs=(column,)
        )

    return make


def stribeck(channel: str, speed: str, width: float, fade: tuple[float, float]) -> Maker:
    """Extra drag near standstill, fading as Tustin has it: exp(−|ω| / ω_s)."""

    def make(rng: Generator, world: World) -> Effect:
        speeds = world.drive.columns[speed]
        shape = np.tanh(speeds / width) * np.exp(-np.abs(speeds) / rng.uniform(*fade))
        name, axes = "stribeck-friction", world.machine.every_axis
        largest = 10 * world.mean_size(channel)
        return Effect(name, name, channel, "wheel_speed", axes, added=lambda size: size * shape, largest=largest)

    return make


def quadratic(channel: str, speed: str, width: float, top: float) -> Maker:
    """Drag of a fan or brush roller that also turns at rest: (|ω| + ω₀)² − ω₀², ω₀ a twentieth of the top speed."""

    def make(_: Generator, world: World) -> Effect:
        speeds, idle = world.drive.columns[speed], top / 20
        shape = np.tanh(speeds / width) * ((np.abs(speeds) + idle) ** 2 - idle**2) / top**2
        name, axes, largest = "quadratic-drag", world.machine.every_axis, 10 * world.mean_size(channel)
        return Effect(name, name, channel, "wheel_speed", axes, added=lambda size: size * shape, largest=largest)

    return make


def cold_lubricant(channel: str, speed: str, width: float, temperature: str) -> Maker:
    """Drag that follows Vogel's viscosity, over what it is at 60 °C."""

    def viscosity(celsius: Array | float) -> Array | float:
        return np.exp(VOGEL_B_K / (celsius - VOGEL_T0_DEGC))

    def make(_: Generator, world: World) -> Effect:
        extra = viscosity(world.drive.columns[temperature]) - viscosity(60.0)
        shape = np.tanh(world.drive.columns[speed] / width) * extra / viscosity(0.0)
        name, axes = "cold-lubricant-friction", world.machine.every_axis
        largest = 10 * world.mean_size(channel)
        return Effect(
            name,
            name,
            channel,
            "temperature",
            axes,
            added=lambda size: size * shape,
            largest=largest,
            needs=(temperature,),
        )

    return make


def magnet_temperature(channel: str, temperature: str) -> Maker:
    """Flux that falls with temperature: the same torque needs 1 / (1 − α (T − 20 °C)) of the current."""

    def make(_: Generator, world: World) -> Effect:
        warmer = world.drive.columns[temperature] - 20.0
        name, axes = "torque-constant-temperature", world.machine.every_axis
        return Effect(
            name,
            name,
            channel,
            "temperature",
            axes,
            added=lambda size: world.base[channel] * (1 / (1 - size * warmer) - 1),
            largest=0.008,
            needs=(temperature,),
        )

    return make


def gear_losses(channel: str, speed: str, width: float) -> Maker:
    """Losses in the teeth: a share of the torque carried, always against the motion."""

    def make(_: Generator, world: World) -> Effect:
        shape = np.tanh(world.drive.columns[speed] / width) * np.abs(world.base[channel])
        name, axes = "load-dependent-efficiency", world.machine.every_axis
        return Effect(name, name, channel, "torque", axes, added=lambda size: size * shape)

    return make


def bearing(channel: str, speed: str, width: float) -> Maker:
    """One axis whose drag grows from an onset on: as a share of its final size 1 − exp(−(t − t₀) / τ)."""

    def make(rng: Generator, world: World) -> Effect:
        axes, onset = one_axis(rng, world), later(rng, world)
        t_s = world.drive.t_s
        lasts = rng.uniform(0.05, 0.2) * (t_s[-1] - t_s[0])
        grown = 1 - np.exp(-np.clip(t_s - onset, 0, None) / lasts)
        shape = np.tanh(world.drive.columns[speed] / width) * grown[:, None] * spread(axes, world)
        largest = 5 * world.mean_size(channel)
        return Effect(
            "bearing-drag",
            "bearing-drag",
            channel,
            "time",
            axes,
            added=lambda size: size * shape,
            onset_s=onset,
            largest=largest,
        )

    return make


def current_bias(channel: str) -> Maker:
    """One current reading that is offset, whatever happens."""

    def make(rng: Generator, world: World) -> Effect:
        axes = one_axis(rng, world)
        shape = np.ones((len(world.drive.t_s), 1)) * spread(axes, world) * rng.choice([-1.0, 1.0])
        name, largest = "current-sensor-bias", 3 * world.mean_size(channel)
        return Effect(name, name, channel, "none", axes, added=lambda size: size * shape, largest=largest)

    return make


def late(channel: str, most_s: float) -> Maker:
    """Delay a channel, on all axes."""

    def make(_: Generator, world: World) -> Effect:
        return Effect(
            "sensor-delay",
            "sensor-delay",
            channel,
            "time",
            world.machine.every_axis,
            delays=True,
            largest=most_s,
            parameters=lambda size: {"delay_s": size},
        )

    return make


def unnamed(
    kind: str, channel: str, covariate: str, shape: Array, world: World, axes: tuple[int, ...] | None = None
) -> Effect:
    """Return an effect that the contract's list does not have, proportional to its size."""
    on = world.machine.every_axis if axes is None else axes
    scaled = shape / np.abs(shape).max() * spread(on, world)
    largest = 40 * world.mean_size(channel)
    return Effect(None, kind, channel, covariate, on, added=lambda size: size * scaled, largest=largest)


def spells(rng: Generator, world: World) -> Array:
    """Return 1 within three spells of the recording, and 0 between them."""
    part = (world.drive.t_s - world.drive.t_s[0]) / np.ptp(world.drive.t_s)
    on = np.zeros_like(part)
    for spell in range(3):
        start = (spell + rng.uniform(0.1, 0.5)) / 3
        on[(part > start) & (part < start + rng.uniform(0.08, 0.15))] = 1
    return on


def caught(channel: str, speed: str, width: float) -> Maker:
    """One axis that is caught in a few spells and free between them."""

    def make(rng: Generator, world: World) -> Effect:
        axes = one_axis(rng, world)
        shape = np.tanh(world.drive.columns[speed] / width) * spells(rng, world)[:, None]
        return unnamed("caught-in-spells", channel, "time", shape, world, axes)

    return make
