"""A fleet whose columns are known at each instant: what its sums give can be computed from the columns directly.

The columns are those of a parameter of the simulation (`gain`) and of three candidates, all random. Time is short, so
that a whole choice takes milliseconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.candidate import Candidate, Coefficient
from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations, fleet_equations
from regolithd.calibration.mismatch.fleet.choice.terms import FleetTerm, Units
from regolithd.calibration.mismatch.fleet.work.fleet_curve import FleetCurve
from regolithd.calibration.mismatch.fleet.work.grid import GridGroup
from regolithd.calibration.mismatch.fleet.work.sums import Sums

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.fleet.choice.courses import Course
    from regolithd.calibration.mismatch.fleet.choice.equations import Level
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit

Array = NDArray[np.float64]

WHEELS = ("left", "right")
INSTANTS, BLOCKS = 120, 12
DEVIATION = np.array([0.1, 0.12])
"""Standard deviation of the noise on each wheel."""
PRIOR_STD = 0.2
ALL = (0, 1)
"""Indices of all wheels, and of both rovers."""


class Drag(Candidate):
    """A drag of one coefficient, on all wheels or one."""

    name, covariate, equation, words = "steady-drag", "wheel_speed", "Δy = k ω", "drag that grows with speed"
    experiment = "drive at several {wheel_speed}s"
    coefficients: ClassVar = (Coefficient("drag", "{unit} s/rad"),)


class Wear(Candidate):
    """A change by its nature, of one wheel."""

    name, covariate, equation, words = "wear", "time", "Δy = y_b g(t)", "drag that was not there at first"
    experiment = "repeat the beginning"
    run_unloaded = True
    coefficients: ClassVar = (Coefficient("worn"),)
    sharing: ClassVar = ("one",)


class Wave(Candidate):
    """Two coefficients of either sign, on all wheels."""

    name, covariate, equation, words = "wave", "wheel_angle", "Δy = a sin θ + b cos θ", "a wave over the angle"
    experiment = "turn a whole turn of the wheel_angle"
    coefficients: ClassVar = (Coefficient("sine", sign=0), Coefficient("cosine", sign=0))
    sharing: ClassVar = ("all",)


GROUPS = (
    GridGroup(Drag(), {}, (1,), 1),
    GridGroup(Wear(), {"onset_s": 0.0}, (2,), 1, begins=True),
    GridGroup(Wave(), {}, (3, 4), 1),
)
DRAG, WEAR, WAVE = GROUPS
COLUMNS = 5
"""The tangent of `gain`, and the candidates' columns."""
KNOTS = len(FleetCurve.coefficients)
BEND: dict[str, float | str] = {"over": "load", "coupling": "offset", "low": 0.0, "high": 7.0}
CURVE = GridGroup(FleetCurve(), BEND, tuple(range(COLUMNS, COLUMNS + KNOTS)), 1)
"""A curve, whose columns come after those."""


@dataclass(frozen=True, eq=False)
class Drive:
    """One recording: columns, shape (column, time, wheel), and the residual, shape (time, wheel)."""

    columns: Array
    residual: Array

    @property
    def groups(self) -> tuple[GridGroup, ...]:
        """The candidates, and the curve where it has its columns."""
        return (*GROUPS, CURVE) if len(self.columns) > COLUMNS else GROUPS

    def sums(self, mean_size: float = 1.0, wheel_sets: tuple[tuple[int, ...], ...] = ()) -> Sums:
        """Return the sums of products that a comparison makes of it."""
        weights = 1 / DEVIATION**2
        products = np.einsum("ctw,tw->ctw", self.columns, self.residual * weights)
        return Sums(
            wheels=WHEELS,
            tangents=("gain",),
            prior_stds=np.array([PRIOR_STD]),
            places=tuple(group.columns for group in self.groups),
            penalties=np.zeros(len(self.groups)),
            own=(),
            gram=np.einsum("ctw,dtw->wcd", self.columns, self.columns),
            moment=np.einsum("ctw,tw->wc", self.columns, self.residual),
            fourth=np.sum(self.columns**4, axis=1).T,
            energy=np.sum(self.residual**2, axis=0),
            counts=np.full(len(WHEELS), float(INSTANTS)),
            weights=weights,
            blocks=products.reshape(len(self.columns), BLOCKS, -1, len(WHEELS)).sum(axis=2).transpose(1, 2, 0),
            mean_size=mean_size,
            wheel_sets=wheel_sets,
            reductions=np.ones(len(self.groups)),
        )


def drive(seed: int, concealed: Mapping[tuple[int, int], float] | None = None, count: int = COLUMNS) -> Drive:
    """Return a recording of so many columns with noise and concealed effects: sizes by (column, wheel)."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(count, INSTANTS, len(WHEELS)))
    residual = rng.normal(size=(INSTANTS, len(WHEELS))) * DEVIATION
    for (column, wheel), size in (concealed or {}).items():
        residual[:, wheel] += size * columns[column, :, wheel]
    return Drive(columns, residual)


def on_both(column: int, size: float) -> dict[tuple[int, int], float]:
    """Return an effect of the same size on both wheels."""
    return {(column, wheel): size for wheel in ALL}


def equations_of(drives: Sequence[Drive], rover: Sequence[int], level: Level = "rover") -> FleetEquations:
    """Return the equations of recordings, one a day, of these rovers."""
    return fleet_equations([each.sums() for each in drives], rover, range(len(drives)), drives[0].groups, level)


def term(group: GridGroup, course: Course, rovers: Sequence[int] = (0,), wheels: Sequence[int] = ALL) -> FleetTerm:
    """Return a term of one size on some wheels of some rovers."""
    units = Units(tuple(rovers), tuple(wheels), "all" if len(wheels) == len(WHEELS) else "one")
    return FleetTerm(group, units, course)


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Weighted least squares of the readings themselves, with the priors as further readings.

    Attributes
    ----------
    coefficients, covariance: of the same coefficients as the fleet's fit
    chi2: weighted sum of squares that is left, of readings and priors
    left: what is left of each recording's residual, shape (recording, time, wheel)
    """

    coefficients: Array
    covariance: Array
    chi2: float
    left: Array


def least_squares(drives: Sequence[Drive], fit: FleetFit, used: Sequence[int] | None = None) -> LeastSquares:
    """Fit the coefficients of a fleet's fit to the readings of the `used` recordings, without any sums."""
    rows, right = [], []
    designs = np.array(
        [np.einsum("jtw,jw->jtw", each.columns[fit.columns], fit.factors[:, i]) for i, each in enumerate(drives)]
    )
    for i in range(len(drives)) if used is None else used:
        rows.append((designs[i] / DEVIATION).reshape(len(fit.columns), -1).T)
        right.append((drives[i].residual / DEVIATION).ravel())
    free = np.flatnonzero(fit.columns == 0)
    rows.append(np.eye(len(fit.columns))[free] / PRIOR_STD)
    right.append(np.zeros(len(free)))
    matrix, wanted = np.concatenate(rows), np.concatenate(right)
    found = np.linalg.lstsq(matrix, wanted, rcond=None)[0]
    left = np.array([each.residual for each in drives]) - np.einsum("j,ijtw->itw", found, designs)
    return LeastSquares(found, np.linalg.inv(matrix.T @ matrix), float(np.sum((wanted - matrix @ found) ** 2)), left)
