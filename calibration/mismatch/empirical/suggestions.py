"""Closed forms in the place of an empirical curve: fitted by the same likelihood, ranked by evidence, never a finding.

Each form of the grammar is fitted with the free parameters and the named effects beside it, with or without a constant.
The Bayesian information criterion (Schwarz, 1978) charges each coefficient and shape parameter ln n, n being the number
of independent readings: a form of two parameters has to fit better than one of one. Of each family the best is kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.empirical.grammar import ClosedForm, Span, grammar
from regolithd.calibration.mismatch.empirical.sums import profile, squares_on_fold

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.empirical.sums import CovariateSums, Profile

Array = NDArray[np.float64]

SUGGESTED = 3
"""Closed forms that are offered (a choice: more are a list of all)."""
REFINEMENTS = 80
"""Shapes that are tried between the points of a grid (a choice: to a thousandth of its spacing)."""
SINGULAR = 1e-9
"""Relative eigenvalue below which a column is one of the others beside it."""
EDGE = 1e-3
"""Share of a grid's range from which on a shape parameter is at its end (a choice: within the refinement)."""
AMONG_EXPONENTS = 2 * float(np.log(10))
"""Δχ² charged for the choice among ten powers where the exponent is not 1: 2 ln 10."""
DIFFERENCE = 0.01
"""Step of the derivatives by a shape parameter, as a share of the range of its grid (a choice: a step has a slope)."""


@dataclass(frozen=True, eq=False)
class FittedForm:
    """A closed form at its best shape.

    Attributes
    ----------
    constant: whether a constant stands beside it; it is the last of the coefficients then
    shape, coefficients: parameters in the form's order
    gain: Δχ² over nothing
    """

    form: ClosedForm
    constant: bool
    shape: Array
    coefficients: Array
    gain: float

    @property
    def parameters(self) -> int:
        """Number of coefficients and shape parameters."""
        return len(self.shape) + len(self.coefficients)

    def values(self, x: Array) -> Array:
        """Return the function, shape (bin,)."""
        return self.coefficients @ _columns(self.form, x, self.shape, constant=self.constant)


def span_of(x: Array) -> Span:
    """Return the ends of a covariate (ascending), its least magnitude and its usual step."""
    steps = np.sort(np.diff(x))
    crossed = np.cumsum(steps)
    usual = steps[np.searchsorted(crossed, crossed[-1] / 2)] if len(steps) else 0.0
    return Span(float(x[0]), float(x[-1]), float(np.min(np.abs(x))), float(usual))


def best_forms(sums: CovariateSums, autocorrelation_time: float) -> list[tuple[float, FittedForm]]:
    """Return the best form of each family with its information criterion, best first."""
    whole, x = profile(sums), sums.at
    span = span_of(x)
    per_parameter = float(np.log(max(float(sums.readings.sum()) / autocorrelation_time, 2.0)))
    best: dict[str, tuple[float, FittedForm]] = {}
    for form in grammar():
        for constant in (False, True) if form.suits(span) else ():
            found = fitted(whole, x, form, constant=constant)
            criterion = per_parameter * found.parameters - found.gain + (0.0 if form.usual else AMONG_EXPONENTS)
            if on_an_edge(found, span) or in_a_gap(found, x):
                continue
            if form.family not in best or criterion < best[form.family][0]:
                best[form.family] = (criterion, found)
    return sorted(best.values(), key=lambda pair: pair[0])


def on_an_edge(found: FittedForm, span: Span) -> bool:
    """Return whether a shape parameter stands at an end of what was searched: there the form is all but another one."""
    grid = found.form.shapes(span)
    low, high = grid.min(axis=0), grid.max(axis=0)
    near = EDGE * (high - low)
    return bool(np.any((found.shape <= low + near) | (found.shape >= high - near)))


def in_a_gap(found: FittedForm, x: Array) -> bool:
    """Return whether a form has its place further than its width from all values (ascending): it may have any size."""
    at = dict(zip(found.form.names, found.shape.tolist(), strict=True))
    return {"a", "k"} <= at.keys() and float(np.min(np.abs(x - at["a"]))) > at["k"]


def fitted(of: Profile, x: Array, form: ClosedForm, *, constant: bool) -> FittedForm:
    """Return a form at its best shape: the best of its grid, refined between the grid's points."""
    grid = form.shapes(span_of(x))
    gains, _ = _gains(of, np.stack([_columns(form, x, shape, constant=constant) for shape in grid]))
    shape = grid[int(np.argmax(gains))]
    if shape.size:
        shape = _refined(of, x, form, grid, shape, constant=constant)
    gain, coefficients = _gain(of, _columns(form, x, shape, constant=constant))
    return FittedForm(form, constant, shape, coefficients, gain)


def held_out_squares(sums: CovariateSums, found: FittedForm) -> Array:
    """Return the sum of squared errors, shape (wheel,), of each fold when the others fitted the form."""
    total = np.zeros(len(sums.weights))
    for fold in sums.folds:
        train = profile(sums, sums.other_folds(fold))
        values = fitted(train, sums.at, found.form, constant=found.constant).values(sums.at)
        total += squares_on_fold(sums, fold, values, train.others(values))
    return total


def standard_deviations(of: Profile, x: Array, found: FittedForm) -> Array:
    """Return those of the coefficients and then of the shape parameters, to first order about the best fit."""
    grid = found.form.shapes(span_of(x))
    columns = [*_columns(found.form, x, found.shape, constant=found.constant)]
    for place in range(len(found.shape)):
        step = DIFFERENCE * float(np.ptp(grid[:, place])) * (np.arange(len(found.shape)) == place)
        ahead, behind = (
            _columns(found.form, x, found.shape + sign * step, constant=found.constant) for sign in (0.5, -0.5)
        )
        columns.append(found.coefficients @ (ahead - behind) / float(step[place]))
    scaled, size = _scaled(np.stack(columns))
    covariance = np.linalg.pinv(scaled @ of.matrix @ scaled.T, rcond=SINGULAR, hermitian=True)
    return np.asarray(np.sqrt(np.maximum(np.diag(covariance), 0.0)) / size)


def _refined(of: Profile, x: Array, form: ClosedForm, grid: Array, shape: Array, *, constant: bool) -> Array:
    """Return the best shape about a point of the grid, by Nelder and Mead's method within the grid's ends."""
    from scipy.optimize import minimize  # noqa: PLC0415  # the laptop's; reading a recording must not load SciPy

    low, high = grid.min(axis=0), grid.max(axis=0)
    wide = (high - low) / max(len(np.unique(grid[:, 0])), 2)
    simplex = np.clip(np.vstack((shape, shape + np.diag(np.where(shape + wide <= high, wide, -wide)))), low, high)
    found = minimize(
        lambda at: -_gain(of, _columns(form, x, at, constant=constant))[0],
        shape,
        method="Nelder-Mead",
        bounds=list(zip(low, high, strict=True)),
        options={"initial_simplex": simplex, "maxfev": REFINEMENTS},
    )
    return np.asarray(found.x, np.float64)


def _columns(form: ClosedForm, x: Array, shape: Array, *, constant: bool) -> Array:
    columns = form.of(x, shape)
    return np.vstack((columns, np.ones(len(x)))) if constant else columns


def _gain(of: Profile, columns: Array) -> tuple[float, Array]:
    """Return the Δχ² of columns over the bins, shape (column, bin), and their coefficients."""
    gains, coefficients = _gains(of, columns[None])
    return float(gains[0]), coefficients[0]


def _gains(of: Profile, columns: Array) -> tuple[Array, Array]:
    """Return the Δχ² of each set of columns over the bins, shape (set, column, bin), and their coefficients."""
    scaled, size = _scaled(columns)
    values, vectors = np.linalg.eigh((scaled @ of.matrix) @ scaled.swapaxes(-1, -2))
    along = ((scaled @ of.moment)[:, None] @ vectors)[:, 0]
    independent = values > SINGULAR * values[:, -1:]
    solved = np.divide(along, values, out=np.zeros(along.shape), where=independent)
    return np.sum(along * solved, axis=-1), (vectors @ solved[..., None])[..., 0] / size


def _scaled(columns: Array) -> tuple[Array, Array]:
    """Return columns, shape (…, column, bin), with a greatest magnitude of 1, and what they were divided by."""
    size = np.maximum(np.max(np.abs(columns), axis=-1), 1e-300)
    return columns / size[..., None], size
