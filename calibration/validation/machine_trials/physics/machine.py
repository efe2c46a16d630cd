"""What a machine of the trials is: its recorded inputs, its true response, and the effects that may be concealed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Readings = dict[str, Array]
"""Channel → what its sensors would read without noise, (time, axes)."""
Values = Mapping[str, float]
Inside = Mapping[str, Array | float]
"""What concealed effects change inside the true machine, by the machine's own keywords."""


@dataclass(frozen=True)
class Known:
    """A parameter of the first simulation: its stated value, and how well it is known."""

    value: float
    std: float
    unit: str


@dataclass(frozen=True)
class Schedule:
    """How often and how long a recording is."""

    rate_Hz: float
    duration_s: float

    @property
    def times_s(self) -> Array:
        """Instants [s]."""
        return np.arange(round(self.rate_Hz * self.duration_s)) / self.rate_Hz


@dataclass(frozen=True)
class Drive:
    """What a machine was made to do: recorded columns in the machine's base units, each (time, axes).

    `compared` is False where the first simulation says nothing (a vehicle at rest).
    """

    t_s: Array
    columns: Mapping[str, Array]
    compared: Mask
    run: NDArray[np.int64] | None = None

    @property
    def step_s(self) -> float:
        """Time between two rows [s]."""
        return float(self.t_s[1] - self.t_s[0])


@dataclass(frozen=True)
class World:
    """A machine on one drive with its true parameters, before anything is concealed."""

    machine: Machine
    drive: Drive
    values: Values

    @cached_property
    def base(self) -> Readings:
        """What the machine's sensors read with nothing concealed."""
        return self.machine.respond(self.drive, self.values, {})

    def mean_size(self, channel: str) -> float:
        """Mean absolute prediction of a channel: what effects and noise are relative to."""
        return float(np.mean(np.abs(self.base[channel][self.drive.compared])))


@dataclass(frozen=True)
class Effect:
    """One concealed effect. Exactly one of `added`, `inside` and `delays` says how it acts at a given size.

    `name` is None for what the contract's list does not have. `needs` are columns without which nobody can see it.
    """

    name: str | None
    kind: str
    channel: str
    covariate: str
    axes: tuple[int, ...]
    added: Callable[[float], Array] | None = None
    inside: Callable[[float], Inside] | None = None
    delays: bool = False
    onset_s: float | None = None
    largest: float = 1.0
    needs: tuple[str, ...] = ()
    parameters: Callable[[float], dict[str, float]] = field(default=lambda _: {})
    size: float = 0.0
    strength: float = 0.0


Maker = Callable[[Generator, World], Effect]
UnitChange = tuple[str, str, float, float]
"""Base column, the name it gets, scale and offset: new = scale · old + offset."""


@dataclass(frozen=True)
class Units:
    """The units of one recording: what is written into the first simulation's text, and which columns change."""

    words: Mapping[str, str]
    changes: tuple[UnitChange, ...] = ()

    def renamed(self, column: str) -> str:
        """Return what a base column is called in these units."""
        return next((new for old, new, _, _ in self.changes if old == column), column)

    def converted(self, column: str, values: Array) -> Array:
        """Return a base column's values in these units."""
        return next((scale * values + offset for old, _, scale, offset in self.changes if old == column), values)


@dataclass(frozen=True)
class Machine:
    """One machine: `axis_column` is empty where there is a single axis."""

    name: str
    axes: tuple[str, ...]
    axis_column: str
    channels: Mapping[str, str]
    parameters: Mapping[str, Known]
    schedules: tuple[Schedule, ...]
    drive: Callable[[Generator, Schedule], Drive]
    respond: Callable[[Drive, Values, Inside], Readings]
    effects: Mapping[str, Maker]
    outside: Mapping[str, Maker]
    lasting: tuple[str, ...]
    """Effects without an onset: what a corrected simulation carries over to a later recording."""
    slow_column: str
    blank_column: str
    base_units: Units
    other_units: Units
    rivals: Mapping[str, Maker] = field(default_factory=dict)
    """Named effects that this machine never conceals, but that an answer might take another for."""
    parameters_have_no_double: bool = True
    """Whether no effect of the contract's list does exactly what a wrong parameter does."""

    @property
    def every_axis(self) -> tuple[int, ...]:
        """Indices of all axes."""
        return tuple(range(len(self.axes)))
