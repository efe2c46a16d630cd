"""Which cases a batch has: machines and kinds in turn, and what each case conceals."""

from __future__ import annotations

import zlib
from collections import Counter
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.validation.machine_trials.machines import MACHINES

if TYPE_CHECKING:
    from numpy.random import Generator

    from regolithd.calibration.validation.machine_trials.physics.machine import Machine

Names = tuple[str, ...]
CORRECTED = ("corrected-unchanged", "corrected-grown", "corrected-gone", "corrected-new")
KINDS = ("nothing", "single", "pair", "outside", "parameter-off", *CORRECTED, "units", "late", "slow", "blank")
TURN = (
    *("nothing", "single", "outside", "units", "corrected-unchanged", "single", "late", "pair"),
    *("nothing", "parameter-off", "corrected-grown", "slow", "outside", "single", "blank", "corrected-gone"),
    *("nothing", "corrected-new", "pair", "outside"),
)
"""Kinds in the order in which a batch takes them; those that matter most come more often."""

NEEDING = {
    "motor_temperature_degC": ("cold-lubricant-friction", "torque-constant-temperature"),
    "bearing_temperature_degC": ("cold-lubricant-friction",),
    "yaw_rate_rad_s": ("turning-resistance",),
}
"""Effects that nobody can see without a column."""


@dataclass(frozen=True)
class Plan:
    """One case. Machine, kind, seed and index make it again, whatever batch it was in."""

    number: int
    seed: int
    machine: str
    kind: str
    index: int
    names: tuple[str, ...]
    """What is concealed, by kind of effect; for `corrected-new` the last one is new in the later recording."""

    @property
    def rng(self) -> Generator:
        """The case's own random numbers."""
        return np.random.default_rng([self.seed, zlib.crc32(f"{self.machine} {self.kind}".encode()), self.index])


def plan_batch(
    seed: int, cases: int, machine: str | None = None, kind: str | None = None, index: int | None = None
) -> list[Plan]:
    """Return a batch's cases; of one machine, kind or index alone, if wanted."""
    if index is not None and machine and kind:
        return [plan_case(0, seed, machine, kind, index)]
    machines, kinds = ([machine] if machine else list(MACHINES)), ([kind] if kind else list(TURN))
    seen: Counter[tuple[str, str]] = Counter()
    plans = []
    for number in range(cases):
        what = kinds[number % len(kinds)]
        able = [name for name in machines if can_have(MACHINES[name], what)]
        if not able:
            continue
        # Each kind begins with another machine, and then takes them in turn.
        who = able[(sum(seen[name, what] for name in able) + KINDS.index(what)) % len(able)]
        plans.append(plan_case(number, seed, who, what, seen[who, what]))
        seen[who, what] += 1
    return plans


def can_have(machine: Machine, kind: str) -> bool:
    """Return whether a kind has one right answer on this machine."""
    return machine.parameters_have_no_double if kind == "parameter-off" else True


def plan_case(number: int, seed: int, machine: str, kind: str, index: int) -> Plan:
    """Return one case."""
    return Plan(number, seed, machine, kind, index, concealed(MACHINES[machine], kind, seed, index))


def concealed(machine: Machine, kind: str, seed: int, index: int) -> tuple[str, ...]:
    """Return what a case conceals: each name in its turn, from a place that the seed sets."""
    turns = turns_of(machine, kind)
    if not turns:
        return ()
    mixed = np.random.default_rng([seed, zlib.crc32(f"{machine.name} {kind} names".encode())]).permutation(len(turns))
    return turns[mixed[index % len(turns)]]


def turns_of(machine: Machine, kind: str) -> list[Names]:
    """Return everything that a case of this kind may conceal on this machine."""
    single: list[Names] = [(name,) for name in machine.effects]
    lasting: list[Names] = [(name,) for name in machine.lasting]
    if kind in {"slow", "blank"}:
        column = machine.slow_column if kind == "slow" else machine.blank_column
        needing: list[Names] = [(name,) for name in NEEDING.get(column, ()) if name in machine.effects]
        return needing * 2 + single
    turns: dict[str, list[Names]] = {
        "single": single,
        "units": [*single, ()],
        "pair": list(combinations(machine.effects, 2)),
        "outside": [(name,) for name in machine.outside],
        "late": [("sensor-delay",)],
        "corrected-unchanged": lasting,
        "corrected-grown": lasting,
        "corrected-gone": lasting,
        "corrected-new": [(old, new) for old in machine.lasting for new in machine.effects if old != new],
    }
    return turns.get(kind, [])
