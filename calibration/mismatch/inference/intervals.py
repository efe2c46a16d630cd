"""How sure the parameters are: a sandwich over blocks of time, with the priors and the shapes in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.answer import Parameter
from regolithd.calibration.mismatch.regression.discrepancy_basis import FORM, bends
from regolithd.calibration.mismatch.regression.residuals import contribution, residual_of
from regolithd.calibration.mismatch.selection.shape_optimisation import Profile

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.selection.subset_selection import Fit, Search, Term

Array = NDArray[np.float64]

DRAWS = 4000
OF_ITS_RANGE = 1e-3
"""Step of a shape parameter, for a slope."""
UNLIKELY = 0.02
"""A shape that fits worse than this, relative to the best, is not counted."""
NINE_TENTHS = 5.94
"""A profile over onsets may fall this far within a 90 % interval. The gain of a sudden change is no parabola but a
random walk to both sides, whose supremum is exponential: (1 − exp(−fall / 2))² = 0.9."""


def parameters_of(search: Search, fit: Fit, blocks: NDArray[np.int64]) -> list[dict[str, Parameter]]:
    """Return each term's parameters with bounds that hold them nine times in ten.

    What the laws may be wrong by (`discrepancy`) is fitted beside them, in one step from where they stand.
    """
    columns, names = _design(search, fit)
    bent = [bends(search, fit, index) for index in range(len(fit.terms))]
    slack = np.concatenate((np.zeros(len(columns)), np.full(sum(map(len, bent)), FORM**-2)))
    slack[: len(search.nuisance.columns)] = search.nuisance.precision
    parts = np.concatenate((columns, *bent))
    step, spread = _sandwich(search, fit, parts, slack, blocks)
    generator = np.random.default_rng(0)
    root = np.linalg.cholesky(spread + 1e-12 * np.trace(spread) / len(spread) * np.eye(len(spread)))
    moved = step + generator.standard_normal((DRAWS, len(spread))) @ root.T
    ends = len(columns) + np.cumsum([0, *map(len, bent)])
    found = []
    for index in range(len(fit.terms)):
        coefficients = fit.of_term(index)
        shapes = [len(fit.columns) + place for place, (term, _, _) in enumerate(names) if term == index]
        at = [*range(coefficients.start, coefficients.stop), *shapes, *range(ends[index], ends[index + 1])]
        size = _sizes(search, fit, index, parts[at], moved[:, at])
        found.append(_of_term(search, fit, index, moved, names, size))
    return found


def _design(search: Search, fit: Fit) -> tuple[Array, list[tuple[int, str, float]]]:
    """Return all columns (column, time, wheel), and what those after the coefficients' are: (term, shape, unit)."""
    dictionary = search.dictionary
    back = np.argsort(dictionary.order)
    parts = []
    for column, wheels in fit.columns:
        values = np.zeros(dictionary.residual.shape)
        for w in wheels:
            values[w] = dictionary.columns[column, w]
        parts.append(values[:, back].T)
    names: list[tuple[int, str, float]] = []
    problem = dictionary.problem
    for index, term in enumerate(fit.terms):
        candidate, shape = term.group.candidate, term.group.shape
        if candidate is None:
            continue
        values = fit.coefficients[fit.of_term(index)] / dictionary.scale[list(term.group.columns)]
        for name, (low, high) in candidate.bounds(problem, shape).items():
            if name in shape and name != "onset_s":
                step = OF_ITS_RANGE * (high - low)
                changed = candidate.columns(problem, {**shape, name: float(shape[name]) + step})
                before = candidate.columns(problem, shape)
                slope = np.einsum("c,ctw->tw", values, changed - before) / step
                on = np.zeros(slope.shape[1])
                on[list(term.wheels)] = 1
                slope = np.where(problem.mask, slope, 0.0) * on
                size = float(np.sqrt(np.mean(slope**2)))
                if size > 0:
                    names.append((index, name, size))
                    parts.append(slope / size)
    return np.stack(parts) if parts else np.zeros((0, *problem.mask.shape)), names


def _sandwich(
    search: Search, fit: Fit, columns: Array, precision: Array, blocks: NDArray[np.int64]
) -> tuple[Array, Array]:
    """Return how far the coefficients would move, and their covariance.

    The covariance is of what the blocks' scores really did, not of what white noise would; `precision` holds the
    priors of those that have one.
    """
    weights = search.weights
    matrix = np.einsum("atw,w,btw->ab", columns, weights, columns, optimize=True)
    inverse = np.linalg.pinv(matrix + np.diag(precision), rcond=1e-9, hermitian=True)
    scores = columns * (residual_of(search, fit) * weights)[None]
    count = int(blocks.max()) + 1
    # Wheels are independent of each other, so each block of each wheel is one draw.
    sums = np.stack([np.add.reduceat(scores, np.flatnonzero(np.diff(blocks, prepend=-1)), axis=1)])[0]
    rows = sums.transpose(1, 2, 0).reshape(-1, len(matrix))
    middle = rows.T @ rows * count / max(count - 1, 1) + np.diag(precision)
    # The fit's own coefficients are where they want to be, priors and all; what stands beside them is not.
    pull = np.where(np.arange(len(matrix)) < len(fit.columns), 0.0, rows.sum(axis=0))
    return inverse @ pull, inverse @ middle @ inverse


def _of_term(
    search: Search, fit: Fit, index: int, moved: Array, names: list[tuple[int, str, float]], size: Parameter
) -> dict[str, Parameter]:
    dictionary, term = search.dictionary, fit.terms[index]
    candidate, shape = term.group.candidate, term.group.shape
    assert candidate is not None  # noqa: S101  # only named terms come here
    at = fit.of_term(index)
    scale = dictionary.scale[list(term.group.columns)]
    best = fit.coefficients[at] / scale
    central = candidate.parameters(shape, best.tolist())
    drawn: dict[str, list[float]] = {name: [] for name in central}
    free = [(len(fit.columns) + k, name, size) for k, (i, name, size) in enumerate(names) if i == index]
    for row in moved[:1000]:
        other = dict(shape)
        for place, name, unit in free:
            other[name] = float(shape[name]) + row[place] / unit
        for name, value in candidate.parameters(other, ((fit.coefficients[at] + row[at]) / scale).tolist()).items():
            drawn[name].append(value)
    units = {c.name: c.unit.format(unit=dictionary.problem.simulation.unit) for c in candidate.coefficients}
    units |= {name: _unit(name) for name in candidate.free}
    found = {}
    for name, value in central.items():
        low, high = np.quantile(drawn[name], [0.05, 0.95])
        found[name] = Parameter(value, float(min(low, value)), float(max(high, value)), units.get(name, "1"))
    if "onset_s" in shape and "onset_s" in candidate.free:
        found["onset_s"] = Parameter(float(shape["onset_s"]), *_onset_bounds(search, fit, index), "s")
    return {**found, "relative_size": size}


def _unit(name: str) -> str:
    """Return the unit that a shape parameter's name ends in."""
    endings = {"_rad_s": "rad/s", "_degC": "degC", "_K": "K", "_s": "s"}
    return next((unit for ending, unit in endings.items() if name.endswith(ending)), "1")


def _sizes(search: Search, fit: Fit, index: int, parts: Array, moved: Array) -> Parameter:
    """Return the effect's root mean square on its wheels over the channel's mean magnitude.

    `parts` are its columns, what its shape changes and its bends (part, time, wheel); `moved` is how far each went in
    each draw (draw, part).
    """
    problem, term = search.dictionary.problem, fit.terms[index]
    on = list(term.wheels)
    flat = parts[:, :, on].reshape(len(parts), -1)
    gram = flat @ flat.T / problem.mask[:, on].sum()
    drawn = moved.copy()
    drawn[:, : len(term.group.columns)] += fit.coefficients[fit.of_term(index)]
    sizes = np.sqrt(np.maximum(np.einsum("da,ab,db->d", drawn, gram, drawn), 0)) / problem.mean_size
    value = (
        float(np.sqrt(np.mean(contribution(search, fit, index)[:, on][problem.mask[:, on]] ** 2))) / problem.mean_size
    )
    low, high = np.quantile(np.concatenate(_over_shapes(search, fit, index, sizes, value)), [0.05, 0.95])
    return Parameter(value, float(min(low, value)), float(max(high, value)), "1")


def _over_shapes(search: Search, fit: Fit, index: int, sizes: Array, value: float) -> list[Array]:
    """Return draws of an effect's relative size over the kinds of shape that it may as well have.

    Where a reference temperature or the way it grew is not known, neither is what hangs on it: each kind counts, at its
    best, as it fits. `sizes` are draws for the fitted shape, `value` its best.
    """
    problem, term = search.dictionary.problem, fit.terms[index]
    others = [other for i, other in enumerate(fit.terms) if i != index]
    family = [group for group in search.dictionary.groups if group.named and group.name == term.name]
    free = term.group.candidate.free if term.group.candidate else {}
    found: dict[str, tuple[float, Term]] = {}
    for gain, other in search.conditional(others, family):
        kind = str({k: v for k, v in other.group.shape.items() if k not in free})
        if other.wheels == term.wheels and gain > found.get(kind, (0.0, None))[0]:
            found[kind] = gain, other
    best = max((gain for gain, _ in found.values()), default=0.0)
    drawn = []
    for gain, other in found.values():
        if (weight := float(np.exp(0.5 * (gain - best)))) < UNLIKELY:
            continue
        refit = search.fit((*others, other))
        values = contribution(search, refit, len(others))[:, list(term.wheels)][problem.mask[:, list(term.wheels)]]
        size = float(np.sqrt(np.mean(values**2))) / problem.mean_size
        drawn.append(size / max(value, 1e-30) * sizes[: max(int(weight * len(sizes)), 1)])
    return drawn or [sizes]


def _onset_bounds(search: Search, fit: Fit, index: int) -> tuple[float, float]:
    """Return where the gain has fallen by what chance allows, to either side."""
    term = fit.terms[index]
    candidate, shape = term.group.candidate, term.group.shape
    assert candidate is not None  # noqa: S101
    others = [t for i, t in enumerate(fit.terms) if i != index]
    profile = Profile(search, others, candidate, term.wheels)
    problem = search.dictionary.problem
    at, length = float(shape["onset_s"]), problem.length_s
    # How it grew after its onset is not known either: at each onset the best growth counts.
    ways_to_grow = candidate.onset_profiles(problem)

    def gain(onset_s: float) -> float:
        return max(profile({**growth, "onset_s": onset_s}) for growth in ways_to_grow)

    best = max(profile(shape), gain(at))
    bounds = []
    for way in (-1, 1):
        near, far = 0.0, 0.002 * length
        while far < 0.3 * length and gain(at + way * far) > best - NINE_TENTHS:
            near, far = far, 2 * far
        for _ in range(6):
            middle = 0.5 * (near + far)
            inside = gain(at + way * middle) > best - NINE_TENTHS
            near, far = (middle, far) if inside else (near, middle)
        bounds.append(float(np.clip(at + way * far, 0, length)))
    return bounds[0], bounds[1]
