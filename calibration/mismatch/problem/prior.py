"""How well a simulation's parameters and a recording's inputs are known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

RUNS_WITHIN = 0.5
"""Share of a parameter's value within which any simulation can be run, however well the value is said to be known (a
choice)."""
OFTEN_WITHIN = 0.2
"""Share of its value within which a parameter is wrong, where it is wrong at all: an old or rounded value, another
batch (a choice). One that is further away has to explain more."""


@dataclass(frozen=True)
class Prior:
    """A parameter's normal prior density; a `std` of 0 means that the value is exact.

    One that is not `told` is fitted like any other, but is no part of the answer: nobody can act on its value. One that
    a recording would move out of its `bounds`, where it cannot be, is held at its value: something else does that.
    `own` are known deviations of some wheels from the value, of a parameter that is `own_to_each_wheel`.
    """

    value: float
    std: float = 0.0
    unit: str = "1"
    told: bool = True
    bounds: tuple[float, float] = (-inf, inf)
    own: tuple[tuple[str, float], ...] = ()

    def of_one_wheel(self, share: float) -> Prior:
        """Return the prior of one wheel's value about the common one, whose standard deviation is a share of this."""
        return replace(self, std=share * self.std, own=())

    def own_of(self, wheel: int | str) -> float:
        """Return the stated deviation of a wheel from the common value."""
        return dict(self.own).get(str(wheel), 0.0)

    @property
    def is_hardly_known(self) -> bool:
        """Return whether the value may be further off than a value that is wrong usually is."""
        return self.std > OFTEN_WITHIN * abs(self.value)

    def near(self, value: float, stds: float) -> float:
        """Return a value as far as it may be from the prior: within its bounds and its reach."""
        low, high = self.bounds
        furthest = self.furthest(stds) * self.std
        return min(max(value, self.value - furthest, low), self.value + furthest, high)

    def reach(self, stds: float, share: float = OFTEN_WITHIN) -> float:
        """Return how far the value is off if it is wrong [standard deviations]: so many, or this share of the value."""
        return max(stds, share * abs(self.value) / self.std) if self.std > 0 else stds

    def furthest(self, stds: float) -> float:
        """Return how far the value may be off at most [standard deviations]: so many, or `RUNS_WITHIN` of the value."""
        return self.reach(stds, RUNS_WITHIN)

    def out_of_bounds(self, value: float) -> bool:
        """Return whether a fitted value is out of the bounds by more than noise: by half of their width."""
        low, high = self.bounds
        return not low - (high - low) / 2 <= value <= high + (high - low) / 2


@dataclass(frozen=True)
class SensorError:
    """A recorded input's standard error: a fraction of the reading, and a constant.

    Both are independent of each other and from reading to reading.
    """

    relative: float = 0.0
    absolute: float = 0.0


def own_name(parameter: str, wheel: int | str) -> str:
    """Return the name of a wheel's own deviation of a parameter among the values estimated from a recording."""
    return f"{parameter} of {wheel}"


def parted_own_name(name: str, parameters: Iterable[str]) -> tuple[str, str] | None:
    """Return which of these parameters, and which wheel, an own deviation is of; None: it is none of theirs."""
    of = [each for each in parameters if name.startswith(own_name(each, ""))]
    return (of[0], name.removeprefix(own_name(of[0], ""))) if of else None
