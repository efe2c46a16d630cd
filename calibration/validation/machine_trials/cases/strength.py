"""How strong an effect is, and how far the recording tells it from everything else that could be in it.

The strength is the effect's root mean square where it acts, over the channel's mean absolute prediction. The margin is
the least Δχ² by which the truth fits better than the base model with one other effect of the list, under the noise as
it is: a case whose margin is small could not be answered by anybody, and is drawn again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.random import Generator

    from regolithd.calibration.validation.machine_trials.physics.machine import (
        Array,
        Effect,
        Mask,
        Readings,
        Values,
        World,
    )

RIVAL_DRAWS = 2
"""How often each rival is drawn: on another axis, from another onset, of another width."""


@dataclass(frozen=True)
class NoiseLaw:
    """Noise of the readings: first-order autoregressive with `phi`, a share `white` of its variance without memory."""

    phi: float
    white: float
    std: dict[str, float]


def readings(world: World, effects: Sequence[Effect]) -> Readings:
    """Return what the sensors read without noise: what acts inside first, then what is added, then what is late."""
    inside = {key: value for e in effects if e.inside for key, value in e.inside(e.size).items()}
    found = dict(world.base if not inside else world.machine.respond(world.drive, world.values, inside))
    for effect in effects:
        if effect.added is not None:
            found[effect.channel] = found[effect.channel] + effect.added(effect.size)
    for effect in effects:
        if effect.delays:
            found[effect.channel] = delayed(world, found[effect.channel], effect.size)
    return found


def delayed(world: World, values: Array, delay_s: float) -> Array:
    """Return a channel that is late by `delay_s`, each run for itself."""
    t_s, run = world.drive.t_s, world.drive.run
    runs = np.zeros(len(t_s), dtype=int) if run is None else run
    late = np.empty_like(values)
    for one in np.unique(runs):
        rows = runs == one
        for axis in range(values.shape[1]):
            late[rows, axis] = np.interp(t_s[rows] - delay_s, t_s[rows], values[rows, axis])
    return late


def contribution(world: World, effect: Effect) -> Array:
    """Return what one effect alone adds to its channel."""
    return readings(world, [effect])[effect.channel] - world.base[effect.channel]


def relative_strength(world: World, effect: Effect) -> float:
    """Return the effect's root mean square where it acts over the mean absolute prediction."""
    acting = world.drive.compared.copy()
    acting[:, [axis for axis in world.machine.every_axis if axis not in effect.axes]] = False
    if effect.onset_s is not None:
        acting[world.drive.t_s < effect.onset_s] = False
    power = np.mean(contribution(world, effect)[acting] ** 2)
    return float(np.sqrt(power)) / world.mean_size(effect.channel)


def of_strength(world: World, effect: Effect, strength: float) -> Effect:
    """Return the effect sized for the wanted strength, or at the most that it can be."""

    def missing(size: float) -> float:
        return relative_strength(world, replace(effect, size=size)) - strength

    most = effect.largest
    size = float(brentq(missing, 0, most, xtol=1e-4 * most, rtol=1e-3)) if missing(most) > 0 else most
    sized = replace(effect, size=size)
    return replace(sized, strength=relative_strength(world, sized))


def whitened(values: Array, law: NoiseLaw, std: float, seen: Mask) -> Array:
    """Return a channel's values as innovations of its noise, in units of their deviation; 0 where nothing is seen.

    Exact for any pattern of unseen rows (Kalman filter): a row of zeros in their place would look like a jump, which
    noise with a memory does not have.
    """
    columns = [_innovations(values[:, axis] / std, seen[:, axis], law) for axis in range(values.shape[1])]
    return np.stack(columns, axis=1)


def _innovations(values: Array, seen: Mask, law: NoiseLaw) -> Array:
    """Return the innovations of one axis, shape (time,): a recursion in plain numbers, which arrays would slow down."""
    slow, phi, white = 1 - law.white, law.phi, law.white
    memory, variance, found = 0.0, slow, []
    for value, known in zip(values.tolist(), seen.tolist(), strict=True):
        surprise = gain = 0.0
        if known:
            surprise, gain = value - memory, variance / (variance + white)
        found.append(surprise / (variance + white) ** 0.5)
        memory = phi * (memory + gain * surprise)
        variance = phi * phi * (1 - gain) * variance + slow * (1 - phi * phi)
    return np.array(found)


def difference(world: World, law: NoiseLaw, seen: dict[str, Mask], changed: Readings) -> Array:
    """Return, over all channels, how readings differ from the base model's, in units of noise."""
    parts = [
        whitened(changed[channel] - base, law, law.std[channel], seen[channel]).ravel()
        for channel, base in world.base.items()
    ]
    return np.concatenate(parts)


def parameter_tangents(world: World, law: NoiseLaw, seen: dict[str, Mask]) -> list[Array]:
    """Return what one prior deviation of each parameter changes, in units of noise."""
    tangents = []
    for name, known in world.machine.parameters.items():
        moved: Values = {**world.values, name: world.values[name] + known.std}
        changed = world.machine.respond(world.drive, moved, {})
        tangents.append(difference(world, law, seen, changed))
    return tangents


def rivals(rng: Generator, world: World, law: NoiseLaw, seen: dict[str, Mask], besides: set[str | None]) -> list[Array]:
    """Return the other named effects that fit this machine, drawn afresh, in units of noise."""
    found = []
    for name, maker in {**world.machine.effects, **world.machine.rivals}.items():
        for _ in range(RIVAL_DRAWS if name not in besides else 0):
            effect = of_strength(world, maker(rng, world), 0.15)
            found.append(difference(world, law, seen, readings(world, [effect])))
    return found


def margin(target: Array, free: list[Array], priors: list[Array], others: list[Array]) -> float:
    """Return the least Δχ² of the target that parameters within their priors, what is free, and one other leave over.

    Half the Δχ² over no other effect counts as well: an effect must be seen before it can be told from others.
    """
    alone = unexplained(target, free, priors)
    return min([alone / 2, *(unexplained(target, [*free, other], priors) for other in others)])


def unexplained(target: Array, free: list[Array], priors: list[Array]) -> float:
    """Return the χ² of a target after generalised least squares on columns, those with priors penalised by them."""
    if not free and not priors:
        return float(target @ target)
    columns = np.stack([*(one / max(float(np.linalg.norm(one)), 1e-12) for one in free), *priors], axis=1)
    penalty = np.diag([1e-9] * len(free) + [1.0] * len(priors))
    cross = columns.T @ target
    return float(target @ target - cross @ np.linalg.solve(columns.T @ columns + penalty, cross))
