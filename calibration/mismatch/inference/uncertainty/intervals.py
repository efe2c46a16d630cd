"""90 % intervals of each effect's parameters, with the priors, the shapes and inexact laws in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.answer import Parameter
from regolithd.calibration.mismatch.inference.uncertainty.onset_interval import onset_interval
from regolithd.calibration.mismatch.inference.uncertainty.parameter_interval import interval
from regolithd.calibration.mismatch.inference.uncertainty.sandwich import Linearisation, Sandwich, linearised, sandwich
from regolithd.calibration.mismatch.inference.uncertainty.size_interval import relative_size_interval
from regolithd.calibration.mismatch.problem.corrections.size_posterior import SizePosterior
from regolithd.calibration.mismatch.problem.words import ANGULAR_SPEED, in_units, speed_unit

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]
Index = NDArray[np.int64]

OF_SIGN = {1: (0.0, np.inf), -1: (-np.inf, 0.0)}
"""Bounds of a coefficient that has one sign alone."""
EXPONENT, PER_POWER = "power", "^p"
"""Name of an exponent, and what the unit of a coefficient has that is per unit to the power of it."""
UNIT_OF_ENDING = {"_rad_s": ANGULAR_SPEED, "_degC": "degC", "_K": "K", "_s": "s"}


@dataclass(frozen=True, eq=False)
class Drawn:
    """Draws of everything uncertain in a fit.

    Attributes
    ----------
    linearisation: what the columns of `moved` are
    moved: how far each went from where the fit stands, shape (draw, column)
    sandwich: the density that they are from
    """

    linearisation: Linearisation
    moved: Array
    sandwich: Sandwich


def drawn_from(equations: NormalEquations, fit: Fit, blocks: Index) -> Drawn:
    """Return draws from the density of a fit's coefficients, shapes and discrepancies."""
    linearisation = linearised(equations, fit)
    found = sandwich(equations, fit, linearisation, blocks)
    moved = found.step + normal_draws(found.covariance, equations.thresholds.interval_draws)
    for stated in linearisation.shares:
        moved = stated.at_most_one(moved, found.inverse)
    return Drawn(linearisation, moved, found)


def parameters_of(equations: NormalEquations, fit: Fit, drawn: Drawn) -> list[dict[str, Parameter]]:
    """Return each term's parameters with bounds that hold them nine times in ten."""
    linearisation, moved = drawn.linearisation, drawn.moved
    found = []
    for index in range(len(fit.terms)):
        at = linearisation.of_term(fit, index)
        size = relative_size_interval(equations, fit, index, linearisation.columns[at], moved[:, at])
        found.append(_of_term(equations, fit, index, moved, linearisation) | {"relative_size": size})
    return found


def law_stds_of(fit: Fit, drawn: Drawn) -> list[float]:
    """Return the relative standard deviation of each term's law as it is carried to another recording.

    In this recording a law's discrepancy stands for a part of what the law says, so that both together are known better
    than the law; another recording has a discrepancy of its own. It is of how far the law moves along itself: a
    coefficient and a shape parameter that make up for each other leave it where it is.
    """
    found = []
    for index in range(len(fit.terms)):
        of_law = drawn.linearisation.of_law(fit, index)
        along = _along_the_law(fit, index, drawn.linearisation.columns[of_law])
        found.append(float(np.std(drawn.moved[:, of_law] @ along)))
    return found


def size_posteriors_of(equations: NormalEquations, fit: Fit, drawn: Drawn) -> list[SizePosterior | None]:
    """Return each term's size together with the simulation's parameters; None where these are all exact."""
    nuisance, problem = equations.nuisance, equations.problem
    places = [k for k, name in enumerate(nuisance.names) if name in problem.simulation.parameters]
    if not places:
        return [None] * len(fit.terms)
    scale = equations.design.scale[[nuisance.columns[place] for place in places]]
    shifts = fit.coefficients[places] / scale
    names = [nuisance.names[place] for place in places]
    values = {name: problem.values[name] + shift for name, shift in zip(names, shifts.tolist(), strict=True)}
    moved = drawn.moved[:, places] / scale
    found: list[SizePosterior | None] = []
    for index in range(len(fit.terms)):
        of_term = drawn.linearisation.of_term(fit, index)
        sizes = drawn.moved[:, of_term] @ _along_the_law(fit, index, drawn.linearisation.columns[of_term])
        found.append(
            SizePosterior.of(values, np.asarray(np.cov(np.column_stack((moved, sizes)), rowvar=False), np.float64))
        )
    return found


def _along_the_law(fit: Fit, index: int, columns: Array) -> Array:
    """Return how much of a term a unit of each of its columns is, shape (column,); its coefficients' come first."""
    flat = columns.reshape(len(columns), -1)
    coefficients = fit.coefficients[fit.of_term(index)]
    law = coefficients @ flat[: len(coefficients)]
    return np.asarray(flat @ law / max(float(law @ law), 1e-300))


def normal_draws(covariance: Array, count: int) -> Array:
    """Return draws from a normal density about 0, shape (draw, dimension); always the same ones."""
    generator = np.random.default_rng(0)
    dimension = len(covariance)
    jitter = 1e-12 * np.trace(covariance) / dimension * np.eye(dimension)
    root = np.linalg.cholesky(covariance + jitter)
    return np.asarray(generator.standard_normal((count, dimension)) @ root.T)


def _of_term(
    equations: NormalEquations, fit: Fit, index: int, moved: Array, linearisation: Linearisation
) -> dict[str, Parameter]:
    """Return a term's coefficients and shape parameters."""
    term = fit.terms[index]
    candidate, shape = term.group.candidate, term.group.shape
    assert candidate is not None  # noqa: S101  # only named terms come here
    at = fit.of_term(index)
    scale = equations.design.scale[list(term.group.columns)]
    central = candidate.parameters(shape, (fit.coefficients[at] / scale).tolist())
    drawn: dict[str, list[float]] = {name: [] for name in central}
    free = [(len(fit.columns) + k, slope) for k, slope in enumerate(linearisation.slopes) if slope.term == index]
    growth = _growth_with_exponent(fit, index, linearisation)
    beyond = normal_draws(np.eye(1), len(moved))[:, 0]
    for row, more in zip(moved[: equations.thresholds.parameter_draws], beyond, strict=False):
        other = dict(shape)
        for place, slope in free:
            left_open = more * candidate.left_open(equations.problem, slope.name)
            other[slope.name] = float(shape[slope.name]) + row[place] / slope.scale + left_open
        more_power = float(other.get(EXPONENT, 0.0)) - float(shape.get(EXPONENT, 0.0)) if growth else 0.0
        moved_to = (fit.coefficients[at] * (1 + growth * more_power) + row[at]) * np.exp(-growth * more_power)
        for name, value in candidate.parameters(other, (moved_to / scale).tolist()).items():
            drawn[name].append(value)
    channel, labels = equations.problem.simulation.unit, equations.problem.labels
    units = {c.name: in_units(c.unit, channel, labels) for c in candidate.coefficients}
    units |= {name: unit_of(name, labels) for name in (*candidate.free, *candidate.refined)}
    signs = zip(candidate.coefficients, term.group.signs, strict=False)  # both phases of a ripple are one amplitude
    bounds, fitted = candidate.bounds(equations.problem, shape), candidate.continuous(equations.problem, shape)
    limits = {c.name: OF_SIGN[sign] for c, sign in signs if sign} | dict(bounds)
    found = {
        name: interval(value, drawn[name], units.get(name, "1"), limits.get(name)) for name, value in central.items()
    }
    if growth:  # the coefficient that goes with the exponent that is told
        name, more_power = candidate.coefficients[0].name, found[EXPONENT].value - central[EXPONENT]
        value = central[name] * float(np.exp(-growth * more_power))
        found[name] = interval(value, drawn[name], units[name], limits.get(name))
    for name in candidate.refined:
        if name in found:
            found[name] = _within(found[name], fitted[name]) if name in fitted else held(central[name], units[name])
    onset = candidate.change_point
    if onset in shape and onset in candidate.free:
        found[onset] = Parameter(*onset_interval(equations, fit, index), unit_of(onset, labels))
    return found


def _growth_with_exponent(fit: Fit, index: int, linearisation: Linearisation) -> float:
    """Return by which share a law grows with its exponent, where its coefficient's unit has that; 0 of other laws.

    It is the mean logarithm of what the exponent is of. The law's size is known better than both: a coefficient for one
    unit of speed, where one unit is far from all readings, falls exponentially as the exponent grows.
    """
    candidate = fit.terms[index].group.candidate
    slopes = enumerate(linearisation.slopes, len(fit.columns))
    of_exponent = [(place, slope) for place, slope in slopes if slope.term == index and slope.name == EXPONENT]
    if candidate is None or not of_exponent or PER_POWER not in candidate.coefficients[0].unit:
        return 0.0
    (place, slope) = of_exponent[0]
    at = fit.of_term(index)
    law = np.tensordot(fit.coefficients[at], linearisation.columns[at], 1).ravel()
    grown = slope.scale * linearisation.columns[place].ravel()
    return float(grown @ law / max(float(law @ law), 1e-300))


def _within(found: Parameter, ends: tuple[float, float]) -> Parameter:
    """Return a value that is told as it was fitted, with its interval within its range."""
    low, high = np.clip((found.low, found.high), *ends).tolist()
    return Parameter(found.value, min(low, found.value), max(high, found.value), found.unit)


def held(value: float, unit: str) -> Parameter:
    """Return a usual value that the recording did not move: it has no interval."""
    return Parameter(value, float("nan"), float("nan"), unit)


def unit_of(name: str, labels: Mapping[str, str]) -> str:
    """Return the unit that a shape parameter's name ends in; of a speed, the machine's own."""
    unit = next((unit for ending, unit in UNIT_OF_ENDING.items() if name.endswith(ending)), "1")
    return speed_unit(labels) if unit == ANGULAR_SPEED else unit
