"""Tangents of a simulation that switches: along the principal axes of the parameters' posterior.

A thermostat, a relief valve or a gear box changes over at a reading that depends on the parameters. A difference
quotient has a jump for each change-over that comes a reading earlier, which no small step makes smaller. In such jumps
the tangents of parameters that act together, of which only ratios can be known, would not cancel: each would seem to be
known.

So the simulation is run along each axis itself, to both sides, over its standard deviation: where nothing changes along
an axis, nothing is seen along it. The axes are those of the tangents, so both are found anew until they agree.

A change-over within an axis that is short makes it seem shorter still, from round to round, and no axes agree. A
parameter by which the simulation switches then has the mean change over its prior's standard deviation to both sides,
in which a change-over is averaged, if these tangents lead to values that fit better.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.prior import OFTEN_WITHIN

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.problem.predictor import Predictor
    from regolithd.calibration.mismatch.problem.prior import Prior
    from regolithd.calibration.mismatch.thresholds import Thresholds

Array = NDArray[np.float64]

ROUNDS = 6
"""Times that the axes are found anew at most (a choice: a direction along which nothing changes is found in three)."""
AGREE = 0.1
"""Change of every axis's standard deviation from which on another round changes nothing (a choice: a tenth of an
interval's width)."""


class Linearised(Protocol):
    """What of a `problem.Problem` is needed here, which documents each."""

    @property
    def simulation(self) -> Predictor:
        """What predicts."""

    @property
    def values(self) -> Mapping[str, float]:
        """The parameters."""

    @property
    def free(self) -> tuple[str, ...]:
        """Those that are fitted."""

    @property
    def measured(self) -> Array:
        """The readings, shape (time, wheel)."""

    @property
    def residual(self) -> Array:
        """What was measured less what is predicted, shape (time, wheel)."""

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Where readings are compared."""

    @property
    def filled(self) -> Array:
        """The prediction, 0 where there is none."""

    @property
    def thresholds(self) -> Thresholds:
        """The numbers that decide."""

    def tangent_step(self, name: str) -> float:
        """Return a parameter's step."""

    def secant(self, name: str, step: float) -> Array:
        """Return the prediction's change per unit over a step."""

    def difference_quotient(self, name: str, step: float | None = None) -> Array:
        """Return the mean of the changes to both sides, over a small step unless told."""

    def changed(self, **changes: float) -> Array:
        """Return the prediction at other values."""


def tangents_where_it_switches(problem: Linearised) -> Array:
    """Return ∂prediction/∂parameter of each free parameter, shape (parameter, time, wheel); none where it is smooth."""
    priors, names = problem.simulation.parameters, problem.free
    if not any(switches(problem, name) for name in names):
        return np.zeros((0, *problem.mask.shape))
    units = np.array([_unit(priors[name], problem.values[name]) for name in names])
    precision = (units / np.array([priors[name].std for name in names])) ** 2
    columns = np.stack([problem.difference_quotient(name) for name in names]) * units[:, None, None]
    before = np.ones(len(names))
    for _ in range(ROUNDS):
        stds, axes = _posterior(problem, columns, precision)
        if np.all(np.abs(stds - before) <= AGREE * before):
            return np.asarray(columns / units[:, None, None])
        along = [
            _along(problem, dict(zip(names, (std * axis * units).tolist(), strict=True)), std)
            for std, axis in zip(stds.tolist(), axes.T, strict=True)
        ]
        known = [
            np.tensordot(axis, columns, 1) if each is None else each for axis, each in zip(axes.T, along, strict=True)
        ]
        columns, before = np.tensordot(axes, np.stack(known), 1), stds
    averaged = np.stack([_averaged(problem, name, unit) for name, unit in zip(names, units.tolist(), strict=True)])
    tried = (np.asarray(columns / units[:, None, None]), averaged)
    return min(tried, key=lambda tangents: _left_after_a_step(problem, tangents, units))


def _left_after_a_step(problem: Linearised, tangents: Array, units: Array) -> float:
    """Return χ² of readings and priors where the simulation is run at the values that tangents lead to.

    The noise is as large as what the present values leave, with the provisional autocorrelation time.
    """
    priors, names = problem.simulation.parameters, problem.free
    values = np.array([problem.values[name] for name in names])
    away = values - np.array([priors[name].value for name in names])
    precision = np.array([priors[name].std for name in names]) ** -2.0
    known = problem.mask & np.isfinite(tangents).all(axis=0)
    columns, left = tangents[:, known], problem.residual[known]
    weight = 1 / (np.mean(left**2) * problem.thresholds.provisional_autocorrelation_time)
    scaled = units[:, None] * units * (weight * columns @ columns.T + np.diag(precision))
    step = units * np.linalg.solve(scaled, units * (weight * columns @ left - precision * away))
    try:
        moved = problem.changed(**dict(zip(names, (values + step).tolist(), strict=True)))
    except SimulationError:
        return np.inf
    left = (problem.residual - (moved - problem.filled))[known]
    return float(weight * np.sum(np.nan_to_num(left) ** 2) + precision @ (away + step) ** 2)


def _averaged(problem: Linearised, name: str, unit: float) -> Array:
    """Return the mean change per unit to both sides over a prior's standard deviation, if the simulation switches."""
    return problem.difference_quotient(name, unit if switches(problem, name) else None)


def switches(problem: Linearised, name: str) -> bool:
    """Return whether the difference quotients to both sides of a value differ by more than a smooth law has them."""
    step = problem.tangent_step(name)
    above, below = (problem.secant(name, each)[problem.mask] for each in (step, -step))
    both = np.isfinite(above) & np.isfinite(below)
    apart, together = above[both] - below[both], above[both] + below[both]
    return float(apart @ apart) > problem.thresholds.switching_share**2 * float(together @ together)


def _unit(prior: Prior, value: float) -> float:
    """Return the standard deviation of a prior, or as far as a value usually is wrong, if that is less."""
    return min(prior.std, OFTEN_WITHIN * abs(value)) if value else prior.std


def _posterior(problem: Linearised, columns: Array, precision: Array) -> tuple[Array, Array]:
    """Return the standard deviation of each principal axis of the posterior, 1 at most, and the axes, shape (of, axis).

    The noise is that which the columns leave on each wheel, with the provisional autocorrelation time.
    """
    limits = problem.thresholds
    information = np.zeros((len(columns), len(columns)))
    for wheel, on in enumerate(problem.mask.T):
        if not on.any():
            continue
        own, left = np.nan_to_num(columns[:, on, wheel]), problem.residual[on, wheel]
        left = left - np.linalg.lstsq(own.T, left, rcond=None)[0] @ own
        rounding = np.finfo(np.float64).eps * np.mean(problem.measured[on, wheel] ** 2)
        power = float(np.maximum(np.mean(left**2), rounding))
        information += own @ own.T / (power * limits.provisional_autocorrelation_time)
    values, axes = np.linalg.eigh(information + np.diag(precision))
    return np.minimum(values**-0.5, 1.0), axes


def _along(problem: Linearised, step: dict[str, float], length: float) -> Array | None:
    """Return the prediction's change per unit along an axis; None where the simulation has no prediction there."""
    ends = [{name: problem.values[name] + sign * each for name, each in step.items()} for sign in (1, -1)]
    try:
        ahead, behind = (problem.changed(**end) for end in ends)
    except SimulationError:
        return None
    change = (ahead - behind) / (2 * length)
    return change if np.isfinite(change[problem.mask]).all() else None
