"""Effects of a fleet: a candidate on some wheels of some rovers, with its course over the recordings; and their fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.fleet.choice.courses import Course
    from regolithd.calibration.mismatch.fleet.work.grid import GridGroup

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Units:
    """Wheels of rovers that share an effect.

    Attributes
    ----------
    rovers, wheels: indices
    sharing: whether these are all wheels of each rover, some, or one
    each: whether each rover has a size of its own
    """

    rovers: tuple[int, ...]
    wheels: tuple[int, ...]
    sharing: Literal["all", "some", "one"] = "all"
    each: bool = False


@dataclass(frozen=True)
class FleetTerm:
    """A candidate in one shape, on some wheels of some rovers, with its course over the recordings."""

    group: GridGroup
    units: Units
    course: Course

    @property
    def name(self) -> str:
        """The candidate's."""
        return self.group.candidate.name

    @property
    def parts(self) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
        """Rovers and wheels that share each of its sizes."""
        rovers, wheels = self.units.rovers, self.units.wheels
        if self.group.of_wheels:
            return tuple(((rover,), (wheel,)) for rover in rovers for wheel in wheels)
        return tuple(((rover,), wheels) for rover in rovers) if self.units.each else ((rovers, wheels),)


@dataclass(frozen=True, eq=False)
class FleetFit:
    """Terms fitted together with the free parameters.

    Attributes
    ----------
    terms: what was fitted, those that have a name first
    columns: of every coefficient, the free parameters' first, shape (coefficient,)
    factors: of every coefficient, shape (coefficient, recording, wheel)
    coefficients, covariance: in physical units
    delta_chi2: below the free parameters alone
    spans: the coefficients of each term
    """

    terms: tuple[FleetTerm, ...]
    columns: NDArray[np.int64]
    factors: Array
    coefficients: Array
    covariance: Array
    delta_chi2: float
    spans: tuple[slice, ...]

    @property
    def named(self) -> tuple[FleetTerm, ...]:
        """The terms that have a name."""
        return tuple(term for term in self.terms if term.group.named)

    @property
    def curves(self) -> tuple[FleetTerm, ...]:
        """The terms that have none."""
        return tuple(term for term in self.terms if not term.group.named)
