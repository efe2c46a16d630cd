"""What was chosen for one predicted channel of a fleet, and what it is told from."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.fleet.choice.intervals import size_stds
from regolithd.calibration.mismatch.fleet.choice.recordings import shown_beside

if TYPE_CHECKING:
    from collections.abc import Sequence
    from datetime import datetime

    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations
    from regolithd.calibration.mismatch.fleet.choice.recordings import Shown
    from regolithd.calibration.mismatch.fleet.choice.selection import Chooser
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit
    from regolithd.calibration.mismatch.fleet.work.found import Found
    from regolithd.calibration.mismatch.simulation.simulation import Simulation

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Names:
    """What rovers and recordings are called, in the order of the sums.

    Attributes
    ----------
    rovers: names of the rovers, by index
    recordings: names of the recordings
    begins: when each began
    """

    rovers: tuple[str, ...]
    recordings: tuple[str, ...]
    begins: tuple[datetime | None, ...]

    def date(self, recording: int) -> str | None:
        """Return when a recording began (ISO 8601)."""
        begins = self.begins[recording]
        return None if begins is None else begins.isoformat().replace("+00:00", "Z")


@dataclass(frozen=True, eq=False)
class Beside:
    """Parameters and effects, fitted with what single recordings show beside them, and their standard deviations."""

    equations: FleetEquations
    fit: FleetFit
    stds: Array

    @classmethod
    def of(cls, equations: FleetEquations, fit: FleetFit, shown: Sequence[tuple[int, int]]) -> Beside:
        """Return them from the equations in which what is shown, by recording and place, takes up what it can."""
        rest = equations.beside(shown)
        again = rest.fit(fit.terms)
        return cls(rest, again, size_stds(rest, again))


@dataclass(frozen=True, eq=False)
class Chosen:
    """The choice for one channel, and what it is told from."""

    chooser: Chooser
    fit: FleetFit
    names: Names
    found: tuple[Found, ...]
    simulation: Simulation

    @property
    def labels(self) -> dict[str, str]:
        """What covariates are called, with their units: as the simulation states it, else as the columns are."""
        of_columns = {name: label for found in reversed(self.found) for name, label in found.labels.items()}
        return {**of_columns, **self.simulation.covariate_labels}

    @property
    def equations(self) -> FleetEquations:
        """Of the fleet."""
        return self.chooser.equations

    @cached_property
    def shown(self) -> Shown:
        """What single recordings show beside the choice."""
        return shown_beside(self.equations, self.fit, self.found)

    @cached_property
    def beside(self) -> Beside:
        """The choice, fitted with what single recordings show."""
        return Beside.of(self.equations, self.fit, self.shown.terms)
