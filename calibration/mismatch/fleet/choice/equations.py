"""Normal equations of a whole fleet, from the sums of its recordings.

A coefficient acts through one column of the sums, with a factor in each recording and on each wheel: a parameter of one
rover has the factor 1 in that rover's recordings, an effect of one wheel since a date on that wheel and since then.
Weights are one over the long-run variance of each recording's noise, so Δχ² is twice a log likelihood ratio.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit
from regolithd.calibration.mismatch.regression.screening.schur import (
    held_by_last,
    pseudo_inverse,
    with_further_readings,
)
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from regolithd.calibration.mismatch.fleet.choice.terms import FleetTerm
    from regolithd.calibration.mismatch.fleet.work.grid import GridGroup
    from regolithd.calibration.mismatch.fleet.work.sums import Sums

Array = NDArray[np.float64]
Level = Literal["shared", "rover", "recording"]
"""Whose a parameter of the simulation is: one value for the fleet, for each rover, or for each recording."""
SINGULAR = 1e-12
"""Relative eigenvalue or energy below which a direction counts as undetermined: rounding of the sums."""


@dataclass(frozen=True, eq=False)
class FleetEquations:
    """The sums of all recordings, aligned.

    Attributes
    ----------
    sums: of each recording
    rover: index of each recording's rover, shape (recording,)
    when: its time, or its place in the order, shape (recording,)
    wheels: names of all wheels
    tangents: names of all tangents
    groups: the candidates of the grid; their columns come after the tangents
    level: whose the parameters are
    gram, moment: weighted, shape (recording, wheel, column, column), (recording, wheel, column)
    reductions: long-run variance of the noise over that at the frequencies of each column, shape (recording, column);
        what such columns know is weighted by so much more (`with_further_readings`)
    released: places, among the coefficients, of parameters whose priors are widened as far as a wrong statement goes
    """

    sums: tuple[Sums, ...]
    rover: NDArray[np.int64]
    when: Array
    wheels: tuple[int | str, ...]
    tangents: tuple[str, ...]
    prior_stds: Array
    groups: tuple[GridGroup, ...]
    level: Level
    gram: Array = field(repr=False)
    moment: Array = field(repr=False)
    weights: Array = field(repr=False)
    reductions: Array = field(repr=False)
    released: frozenset[int] = frozenset()

    @cached_property
    def named_groups(self) -> tuple[GridGroup, ...]:
        """The candidates of the grid that have a name."""
        return tuple(group for group in self.groups if group.named)

    @cached_property
    def curve_groups(self) -> tuple[GridGroup, ...]:
        """The curves, which have none."""
        return tuple(group for group in self.groups if not group.named)

    @cached_property
    def implausibility(self) -> dict[int, float]:
        """Δχ² that each group must gain for being hardly possible in one of the recordings, by its first column."""
        most = np.max([sums.penalties for sums in self.sums], axis=0).tolist()
        return {group.columns[0]: each for group, each in zip(self.groups, most, strict=True)}

    @property
    def count(self) -> int:
        """Number of recordings."""
        return len(self.sums)

    @cached_property
    def recordings_of(self) -> tuple[tuple[int, ...], ...]:
        """The recordings of each rover, in the order of time."""
        rovers = range(int(self.rover.max()) + 1)
        found = [np.flatnonzero(self.rover == rover) for rover in rovers]
        return tuple(tuple(int(i) for i in at[np.argsort(self.when[at], kind="stable")]) for at in found)

    def of_rovers(self, rovers: Iterable[int]) -> tuple[int, ...]:
        """Return the recordings of some rovers, in the order of time."""
        at = np.array(sorted(i for rover in rovers for i in self.recordings_of[rover]), np.int64)
        return tuple(int(i) for i in at[np.argsort(self.when[at], kind="stable")])

    def on_rovers(self, term: FleetTerm, rovers: tuple[int, ...]) -> FleetTerm:
        """Return a term on these rovers."""
        course = term.course.among(self.of_rovers(rovers), self.when)
        return replace(term, units=replace(term.units, rovers=rovers), course=course)

    def factors(self, term: FleetTerm) -> Array:
        """Return the factors of a term's sizes, shape (size, recording, wheel): one for each of its parts."""
        recordings = self.of_rovers(term.units.rovers)
        relative = np.zeros(self.count)
        relative[list(recordings)] = term.course.factors(recordings, self.when)
        found = np.zeros((len(term.parts), self.count, len(self.wheels)))
        for size, (rovers, wheels) in enumerate(term.parts):
            found[size][:, list(wheels)] = np.where(np.isin(self.rover, rovers), relative, 0.0)[:, None]
        return found

    @cached_property
    def parameter_factors(self) -> tuple[NDArray[np.int64], Array, Array]:
        """Columns, factors and prior precisions of the free parameters."""
        owners = {
            "shared": np.zeros(self.count, np.int64),
            "rover": self.rover,
            "recording": np.arange(self.count),
        }[self.level]
        columns, factors = [], []
        for owner in np.unique(owners):
            for column in range(len(self.tangents)):
                columns.append(column)
                factors.append(np.repeat((owners == owner)[:, None], len(self.wheels), axis=1).astype(np.float64))
        shape = (0, self.count, len(self.wheels))
        stacked = np.stack(factors) if factors else np.zeros(shape)
        precision = 1 / self.prior_stds[columns] ** 2 if columns else np.zeros(0)
        precision[list(self.released)] /= THRESHOLDS.furthest_linearisation_stds**2
        return np.array(columns, np.int64), stacked, precision

    def fit(self, terms: Iterable[FleetTerm], used: Array | None = None) -> FleetFit:
        """Fit terms and free parameters together, to all recordings or those with `used` (recording,) of 1."""
        terms = tuple(terms)
        columns, factors, _ = self.parameter_factors
        base, spans = len(columns), []
        parts, places = [factors], [columns]
        for term in terms:
            sizes, before = self.factors(term), sum(map(len, places))
            for of_size in sizes:
                parts.append(np.repeat(of_size[None], len(term.group.columns), axis=0))
                places.append(np.array(term.group.columns, np.int64))
            spans.append(slice(before, before + len(sizes) * len(term.group.columns)))
        at, by = np.concatenate(places), np.concatenate(parts)
        used = np.ones(self.count) if used is None else used
        matrix, moment = self._with_priors(at, by, used)
        inverse = pseudo_inverse(matrix, SINGULAR)
        solved = inverse @ moment
        gained = float(moment @ solved)
        if (rest := self._counting_alike(at, by)).sum() < len(at):
            alone = self._with_priors(at[rest], by[rest], used)
            gained -= _beyond(matrix, moment, rest, alone)
            matrix, moment = alone
        if base:
            gained -= float(moment[:base] @ np.linalg.solve(matrix[:base, :base], moment[:base]))
        return FleetFit(terms, at, by, solved, inverse, gained, tuple(spans))

    def _counting_alike(self, at: NDArray[np.int64], by: Array) -> NDArray[np.bool_]:
        """Return which coefficients know no more than the long-run variance says, shape (coefficient,).

        What these explain of the further readings of others is no gain: without the others it is not asked for.
        """
        return np.asarray(~((self.reductions[:, at].T > 1) & by.any(axis=2)).any(axis=1))

    def _with_priors(self, at: NDArray[np.int64], by: Array, used: Array) -> tuple[Array, Array]:
        """Return matrix and moment of the normal equations, the parameters' priors included."""
        matrix, moment = self._normal(at, by, used)
        precision = self.parameter_factors[2]
        matrix[range(len(precision)), range(len(precision))] += precision
        return matrix, moment

    def held_by_last(self, fit: FleetFit, index: int, with_last: FleetFit, used: Array) -> float:
        """Return the Δχ² that the last term of a larger fit has in common with one of a fit, beside the parameters."""
        base, last = len(self.parameter_factors[0]), with_last.spans[-1].start
        matrix, _ = self._with_priors(with_last.columns, with_last.factors, used)
        size = np.zeros(last - base)
        size[fit.spans[index].start - base : fit.spans[index].stop - base] = fit.coefficients[fit.spans[index]]
        return held_by_last(matrix, base, last, size, SINGULAR)

    def _normal(self, at: NDArray[np.int64], by: Array, used: Array) -> tuple[Array, Array]:
        """Return matrix and moment, summed recording by recording in their order: always the same sum."""
        matrix, moment = np.zeros((len(at), len(at))), np.zeros(len(at))
        for i in np.flatnonzero(used):
            acting = np.flatnonzero(by[:, i].any(axis=1))
            of = at[acting]
            part, of_part = np.zeros((len(acting), len(acting))), np.zeros(len(acting))
            for w in range(len(self.wheels)):
                factor = by[acting, i, w]
                products, own = with_further_readings(*self._acting(i, w, of, factor), self.reductions[i, of], SINGULAR)
                part += products
                of_part += own
            matrix[np.ix_(acting, acting)] += part
            moment[acting] += of_part
        return matrix, moment

    def _acting(self, recording: int, wheel: int, at: NDArray[np.int64], factor: Array) -> tuple[Array, Array]:
        """Return the weighted sums of products of columns with these factors, with each other and the residual."""
        gram = self.gram[recording, wheel][np.ix_(at, at)]
        return np.outer(factor, factor) * gram, factor * self.moment[recording, wheel, at]

    def known(self, recording: int, wheel: int, at: Sequence[int] | NDArray[np.int64]) -> Array:
        """Return the sums of products of columns by what they know, shape (column, column): weighted by reductions."""
        root = np.sqrt(self.reductions[recording, list(at)])
        return np.asarray(np.outer(root, root) * self.gram[recording, wheel][np.ix_(list(at), list(at))])

    def products(self, recording: int, wheel: int, at: Sequence[int] | NDArray[np.int64]) -> Array:
        """Return the sums of products of these columns, unweighted, shape (column, column)."""
        weight = max(float(self.weights[recording, wheel]), 1e-300)
        return np.asarray(self.gram[recording, wheel][np.ix_(list(at), list(at))] / weight)

    def beside(self, terms: Iterable[tuple[int, int]]) -> FleetEquations:
        """Return the equations in which these terms, recordings and places in their `own`, take up what they can.

        Their columns are free on each wheel by itself, and eliminated: what is left is outside their span, and 0 where
        that is rounding.
        """
        gram, moment = self.gram.copy(), self.moment.copy()
        for i, free in _columns_by_recording(self.sums, terms).items():
            sums = self.sums[i]
            own, fleet = column_map(sums, self.tangents, self.groups)
            for w, name in enumerate(sums.wheels):
                k, weight, products = self.wheels.index(name), sums.weights[w], sums.gram[w]
                inverse = pseudo_inverse(products[np.ix_(free, free)], SINGULAR)
                cross = products[np.ix_(own, free)] @ inverse
                gram[i, k][np.ix_(fleet, fleet)] -= weight * (cross @ products[np.ix_(free, own)])
                moment[i, k][fleet] -= weight * (cross @ sums.moment[w, free])
                gone = np.diag(gram[i, k]) <= SINGULAR * np.diag(self.gram[i, k])
                gram[i, k][gone], gram[i, k][:, gone], moment[i, k][gone] = 0.0, 0.0, 0.0
        return replace(self, gram=gram, moment=moment)

    def explained(self, fit: FleetFit, beside: Iterable[tuple[int, int]]) -> float:
        """Return by how much a fit's coefficients, and these terms of `own`, lower χ² when fitted together.

        A term of one recording, by recording and place, has the same coefficients on all of its wheels.
        """
        terms, rest = list(beside), self._counting_alike(fit.columns, fit.factors)
        matrix, moment = self._with_own(fit.columns, fit.factors, terms)
        total = _explained(matrix, moment)
        if not rest.all():
            kept = np.append(rest, np.ones(len(moment) - len(rest), np.bool_))
            total -= _beyond(matrix, moment, kept, self._with_own(fit.columns[rest], fit.factors[rest], terms))
        return total

    def _with_own(self, at: NDArray[np.int64], by: Array, terms: Iterable[tuple[int, int]]) -> tuple[Array, Array]:
        """Return matrix and moment of coefficients, and of these terms of `own`, the priors included."""
        matrix, moment = self._with_priors(at, by, np.ones(self.count))
        for recording, free in _columns_by_recording(self.sums, terms).items():
            energy, cross, own = self._own_of(at, by, recording, free)
            size = len(matrix)
            matrix = np.pad(matrix, (0, len(free)))
            matrix[size:, size:], matrix[size:, : len(at)], matrix[: len(at), size:] = energy, cross.T, cross
            moment = np.append(moment, own)
        return matrix, moment

    def _own_of(
        self, at: NDArray[np.int64], by: Array, recording: int, free: Sequence[int]
    ) -> tuple[Array, Array, Array]:
        """Return the energy of a recording's own columns, their products with a fit's columns, and their moment."""
        sums, count = self.sums[recording], len(at)
        energy, cross, own = np.zeros((len(free), len(free))), np.zeros((count, len(free))), np.zeros(len(free))
        places, fleet = column_map(sums, self.tangents, self.groups)
        reductions = np.append(self.reductions[recording, at], np.ones(len(free)))
        for w, name in enumerate(sums.wheels):
            k = self.wheels.index(name)
            products = np.zeros((self.gram.shape[-1], len(free)))
            products[fleet] = sums.weights[w] * sums.gram[w][np.ix_(places, free)]
            factor = by[:, recording, k]
            of_fit, moment = self._acting(recording, k, at, factor)
            beside = factor[:, None] * products[at]
            of_free = sums.weights[w] * sums.gram[w][np.ix_(free, free)]
            whole, moment = with_further_readings(
                np.block([[of_fit, beside], [beside.T, of_free]]),
                np.append(moment, sums.weights[w] * sums.moment[w, list(free)]),
                reductions,
                SINGULAR,
            )
            energy += whole[count:, count:]
            cross += whole[:count, count:]
            own += moment[count:]
        return energy, cross, own

    def left_moment(self, fit: FleetFit) -> Array:
        """Return the moments of all columns with what a fit leaves, by what they know, (recording, wheel, column)."""
        left = self.moment.copy()
        for i in range(self.count):
            for w in range(len(self.wheels)):
                sizes = fit.coefficients * fit.factors[:, i, w]
                left[i, w] -= sizes @ self.gram[i, w][fit.columns]
        return np.asarray(left * self.reductions[:, None])

    def squares(self, fit: FleetFit) -> Array:
        """Return the sum of squares that a fit leaves, unweighted, shape (recording, wheel)."""
        total = np.zeros((self.count, len(self.wheels)))
        for i, sums in enumerate(self.sums):
            for w, name in enumerate(sums.wheels):
                k = self.wheels.index(name)
                acting = np.flatnonzero(fit.factors[:, i, k])
                sizes, at = (fit.coefficients * fit.factors[:, i, k])[acting], fit.columns[acting]
                moment = self.moment[i, k, at] / sums.weights[w]
                total[i, k] = sums.energy[w] - 2 * sizes @ moment + sizes @ self.products(i, k, at) @ sizes
        return total

    @cached_property
    def counts(self) -> Array:
        """Readings, shape (recording, wheel)."""
        return self._spread([sums.counts for sums in self.sums])

    def _spread(self, values: Sequence[Array]) -> Array:
        """Return values of each recording's own wheels as values of all wheels, shape (recording, wheel)."""
        found = np.zeros((self.count, len(self.wheels)))
        for i, sums in enumerate(self.sums):
            found[i, [self.wheels.index(name) for name in sums.wheels]] = values[i]
        return found


def _explained(matrix: Array, moment: Array) -> float:
    """Return by how much the coefficients of normal equations lower χ²."""
    return float(moment @ pseudo_inverse(matrix, SINGULAR) @ moment)


def _beyond(matrix: Array, moment: Array, kept: NDArray[np.bool_], alone: tuple[Array, Array]) -> float:
    """Return by how much more these coefficients lower χ² among others' further readings than by themselves, `alone`.

    Parameters
    ----------
    matrix, moment: of all coefficients; `kept` are those that know no more than the long-run variance says
    alone: matrix and moment of these without the others
    """
    return _explained(matrix[np.ix_(kept, kept)], moment[kept]) - _explained(*alone)


def _columns_by_recording(sums: Sequence[Sums], terms: Iterable[tuple[int, int]]) -> dict[int, list[int]]:
    """Return the columns of terms that recordings show by themselves, each given by recording and place."""
    found: dict[int, list[int]] = {}
    for recording, place in terms:
        found.setdefault(recording, []).extend(sums[recording].own[place])
    return found


def column_map(sums: Sums, tangents: Sequence[str], groups: Sequence[GridGroup]) -> tuple[list[int], list[int]]:
    """Return places in a recording's sums, and those of the same columns in the fleet's."""
    own = [sums.tangents.index(name) for name in tangents if name in sums.tangents]
    fleet = [place for place, name in enumerate(tangents) if name in sums.tangents]
    for group, places in zip(groups, sums.places, strict=True):
        own += places
        fleet += group.columns[: len(places)]
    return own, fleet


def fleet_equations(
    sums: Sequence[Sums], rover: Sequence[int], when: Sequence[float], groups: Sequence[GridGroup], level: Level
) -> FleetEquations:
    """Align the sums of recordings by the names of wheels and tangents, and weigh them."""
    found = {wheel for each in sums for wheel in each.wheels}
    wheels = tuple(sorted(found, key=lambda wheel: (isinstance(wheel, str), wheel)))
    stds = {name: float(std) for each in sums for name, std in zip(each.tangents, each.prior_stds, strict=True)}
    size = len(stds) + sum(len(group.columns) for group in groups)
    gram = np.zeros((len(sums), len(wheels), size, size))
    moment = np.zeros((len(sums), len(wheels), size))
    weights = np.zeros((len(sums), len(wheels)))
    reductions = np.ones((len(sums), size))
    for i, each in enumerate(sums):
        own, fleet = column_map(each, list(stds), groups)
        for group, reduction in zip(groups, each.reductions, strict=True):
            reductions[i, list(group.columns)] = reduction
        for w, name in enumerate(each.wheels):
            k = wheels.index(name)
            weights[i, k] = each.weights[w]
            gram[i, k][np.ix_(fleet, fleet)] = each.weights[w] * each.gram[w][np.ix_(own, own)]
            moment[i, k][fleet] = each.weights[w] * each.moment[w, own]
    return FleetEquations(
        sums=tuple(sums),
        rover=np.array(rover, np.int64),
        when=np.array(when, np.float64),
        wheels=wheels,
        tangents=tuple(stds),
        prior_stds=np.array(list(stds.values())),
        groups=tuple(groups),
        level=level,
        gram=gram,
        moment=moment,
        weights=weights,
        reductions=reductions,
    )
