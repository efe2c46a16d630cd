"""The choice of a fleet's effects: forwards, each searched anew beside the others, confirmed by other recordings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.late_columns import SENSOR_DELAY
from regolithd.calibration.mismatch.fleet.choice.search import MOST_TERMS, TRIED, further, score
from regolithd.calibration.mismatch.regression.residuals import active_size
from regolithd.calibration.mismatch.signal.chi_squared import quantile
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations
    from regolithd.calibration.mismatch.fleet.choice.search import Place
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit, FleetTerm

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Chooser:
    """What the choice is made from.

    Attributes
    ----------
    equations: of the fleet
    places: sets of units and courses
    entry_threshold: score that a term must bring
    """

    equations: FleetEquations
    places: Sequence[Place]
    entry_threshold: float

    def chosen(self) -> FleetFit:
        """Return the fit of all effects that may be named.

        They are searched twice, with and without effects of several rovers: of different laws on different rovers, one
        that is none of theirs may gain most over all. Each search begins with one law and then with another: of two
        laws that act everywhere, a third that is a little of both may gain most, and leave too little for either.
        """
        alone = [place for place in self.places if len(place.units.rovers) == 1]
        searches = [self.places, alone] if 0 < len(alone) < len(self.places) else [self.places]
        found = [self.grown(start, places) for places in searches for start in self._starts(places)]
        return self.confirmed(max(found, key=self.evidence))

    def evidence(self, fit: FleetFit) -> float:
        """Return the score of a fit less what its effects and curves had to gain to enter."""
        entries = self.entry_threshold * len(fit.named) + THRESHOLDS.smooth_term_entry * len(fit.curves)
        return score(self.equations, fit) - entries

    def _starts(self, places: Sequence[Place]) -> list[FleetFit]:
        """Return the fits of one law each that may be named, in its best place, the best first; or that of none."""
        nothing = self.equations.fit(())
        starts: dict[str, FleetFit] = {}
        for gained, term in further(self.equations, nothing, places):
            if gained <= self.entry_threshold or len(starts) == STARTS:
                break
            if term.name not in starts and self.acceptable(fit := self.equations.fit((term,))):
                starts[term.name] = fit
        return list(starts.values()) or [nothing]

    def grown(self, fit: FleetFit, places: Sequence[Place]) -> FleetFit:
        """Return the fit with further effects, chosen one after the other, each searched anew beside the others."""
        start = fit
        while len(fit.terms) < MOST_TERMS:
            best = self._best_further(fit, places)
            if best is None:
                break
            fit = self.searched_anew(best, places)
        # A law by itself would be exchanged for the best one, with which another search begins.
        searched = self.searched_anew(fit, places) if fit is start else fit
        return self._that_gain_enough(self._merged(searched))

    def _that_gain_enough(self, fit: FleetFit) -> FleetFit:
        """Return the fit without effects that gain too little beside those that were chosen after them."""
        index = 0
        while index < len(fit.terms):
            less = self.equations.fit(without(fit, index))
            if self.worthwhile(less, self.equations.fit((*less.terms, fit.terms[index]))):
                index += 1
            else:
                fit, index = less, 0
        return fit

    def _best_further(self, fit: FleetFit, places: Sequence[Place]) -> FleetFit | None:
        """Return the fit with one more effect, the best that may be named; None: there is none."""
        needed = self.entry_threshold + (THRESHOLDS.further_term_entry if fit.terms else 0.0)
        for gained, term in further(self.equations, fit, places)[:TRIED]:
            if gained <= needed:
                return None
            more = self.equations.fit((*fit.terms, term))
            if self.acceptable(more) and self.worthwhile(fit, more):
                return more
        return None

    def worthwhile(self, less: FleetFit, more: FleetFit) -> bool:
        """Return whether the last effect gains enough beside those on the same rovers: no law is exact.

        Of a delay counts what the last effect can hold of its misfit (`law_misfit.explained_beside`).
        """
        equations, last = self.equations, more.terms[-1]
        here = np.isin(equations.rover, last.units.rovers).astype(np.float64)
        with_it, told = (equations.fit(fit.terms, here) for fit in (more, less))
        holds_all = last.name == SENSOR_DELAY or last.group.candidate.imitated_over == "torque"
        beside = 0.0
        for index, term in enumerate(less.terms):
            if set(term.units.rovers) & set(last.units.rovers):
                explained = told.delta_chi2 - equations.fit(without(less, index), here).delta_chi2
                if term.name == SENSOR_DELAY and not holds_all:
                    explained = min(explained, equations.held_by_last(told, index, with_it, here))
                beside += explained
        return with_it.delta_chi2 - told.delta_chi2 > FURTHER_SHARE * beside

    def searched_anew(self, fit: FleetFit, places: Sequence[Place]) -> FleetFit:
        """Return the fit with each term replaced by the best one on overlapping units beside the others."""
        for index in range(len(fit.terms)):
            rest, old = self.equations.fit(without(fit, index)), fit.terms[index]
            near = [place for place in places if set(place.units.rovers) & set(old.units.rovers)]
            alike = self.equations.named_groups if old.group.named else self.equations.curve_groups
            trials = [term for _, term in further(self.equations, rest, near, alike)[:2]]
            trials += self._on_fewer_rovers(fit, index)
            for term in trials:
                trial = self.equations.fit((*rest.terms[:index], term, *rest.terms[index:]))
                if score(self.equations, trial) > score(self.equations, fit) + 1e-6 and self.acceptable(trial):
                    fit = trial
        return fit

    def _on_fewer_rovers(self, fit: FleetFit, index: int) -> list[FleetTerm]:
        """Return a term of several rovers with a size of each one's own, and on those rovers alone that show it."""
        old = fit.terms[index]
        if len(old.units.rovers) == 1 or old.group.of_wheels:
            return []
        each = replace(old, units=replace(old.units, each=True))
        found = [each] if old.course.kind == "always" else []
        rovers = self.showing(fit, index)
        if rovers not in {(), old.units.rovers}:
            shown = self.equations.on_rovers(each, rovers)
            found += [shown, replace(shown, units=replace(shown.units, each=False))]
        return found

    def _merged(self, fit: FleetFit) -> FleetFit:
        """Return the fit with one term in the place of two of one law on different rovers where that scores more.

        Sets of a few rovers are not searched, and of a rover's single recording no other confirms an effect of its own.
        """
        for one, other in combinations(range(len(fit.terms)), 2):
            for term in self._of_both(fit.terms[one], fit.terms[other]):
                trial = self.equations.fit((*without(fit, one, other), term))
                if score(self.equations, trial) > score(self.equations, fit) and self.acceptable(trial):
                    return self._merged(trial)
        return fit

    def _of_both(self, one: FleetTerm, other: FleetTerm) -> Iterator[FleetTerm]:
        """Yield terms on the rovers of two, where these are one law on the same wheels, since the date of either."""
        apart = set(one.units.rovers).isdisjoint(other.units.rovers)
        if not apart or one.group != other.group or one.units.wheels != other.units.wheels:
            return
        for term in (one, other):
            both = self.equations.on_rovers(term, tuple(sorted((*one.units.rovers, *other.units.rovers))))
            yield from (replace(both, units=replace(both.units, each=each)) for each in (False, True))

    def showing(self, fit: FleetFit, index: int) -> tuple[int, ...]:
        """Return the rovers of a term that show it, each with a size of its own beside the other terms."""
        term = fit.terms[index]
        if term.group.of_wheels:
            return term.units.rovers
        each = replace(term, units=replace(term.units, each=True))
        certain = self._certain(self.equations.fit((*fit.terms[:index], each, *fit.terms[index + 1 :])), index)
        return tuple(rover for rover, shows in zip(term.units.rovers, certain.tolist(), strict=True) if shows)

    def _certain(self, fit: FleetFit, index: int) -> NDArray[np.bool_]:
        """Return which sizes of a term have their signs, and are further from 0 than the entry asks for.

        Of a size that is a rover's own that is asked for each of the rovers, as for having been chosen among them. Of a
        curve all of its knots have to be, together.
        """
        term, span = fit.terms[index], fit.spans[index]
        if not term.group.named:
            return self._certain_curves(fit, index)
        sizes = fit.coefficients[span].reshape(-1, len(term.group.columns))
        variances = np.diag(fit.covariance)[span].reshape(sizes.shape)
        signed = np.all(np.array(term.group.signs) * sizes >= 0, axis=1)
        needed = self.entry_threshold + 2 * np.log(len(self.equations.recordings_of))
        certain = np.divide(sizes**2, variances, out=np.zeros(sizes.shape), where=variances > 0)
        return np.asarray(signed & (np.max(certain, axis=1) >= needed))

    def _certain_curves(self, fit: FleetFit, index: int) -> NDArray[np.bool_]:
        """Return which of a curve's parts explain more than chance beside all else."""
        equations, term, rest = self.equations, fit.terms[index], without(fit, index)
        needed = THRESHOLDS.smooth_term_entry + THRESHOLDS.coefficient_penalty * len(term.group.columns)
        needed += 2 * np.log(len(equations.recordings_of))
        gains = []
        for rovers, _ in term.parts:
            others = tuple(rover for rover in term.units.rovers if rover not in rovers)
            less = equations.fit((*rest, equations.on_rovers(term, others)) if others else rest)
            gains.append(fit.delta_chi2 - less.delta_chi2)
        return np.array(gains) >= needed

    def acceptable(self, fit: FleetFit) -> bool:
        """Return whether every coefficient has its sign, every effect is large enough, and each law has one shape."""
        one_shape = all(_one_shape(*pair) for pair in combinations(fit.terms, 2))
        return one_shape and all(self.acceptable_term(fit, index) for index in range(len(fit.terms)))

    def stands(self, fit: FleetFit) -> bool:
        """Return whether every effect may be named, and recordings that did not fit it confirm it."""
        return self.acceptable(fit) and len(self.confirmed(fit).terms) == len(fit.terms)

    def acceptable_term(self, fit: FleetFit, index: int) -> bool:
        """Return whether an effect has its signs, is large enough, and on each rover whose size is its own certain."""
        term, span = fit.terms[index], fit.spans[index]
        if self._one_wheel_shows_alone(fit, index):
            return False
        if term.units.each:
            if not self._certain(fit, index).all():
                return False
        elif np.any(np.array(term.group.signs) * fit.coefficients[span].reshape(-1, len(term.group.columns)) < 0):
            return False
        return relative_size(self.equations, fit, index) >= THRESHOLDS.smallest_effect

    def _one_wheel_shows_alone(self, fit: FleetFit, index: int) -> bool:
        """Return whether a law of which each wheel has its own coefficients acts on one wheel of all that it is on.

        As in one recording (`best_subsets`): on several it gains a little more by chance.
        """
        term, span, wheels = fit.terms[index], fit.spans[index], len(fit.terms[index].units.wheels)
        if not term.group.of_wheels or wheels == 1 or "one" not in term.group.candidate.sharing:
            return False
        values, covariance = fit.coefficients[span], fit.covariance[span, span]
        of_wheel = np.repeat([wheel for _, (wheel,) in term.parts], len(term.group.columns))
        gains: list[float] = []  # of the coefficients of all wheels but one
        for wheel in term.units.wheels:
            rest = np.flatnonzero(of_wheel != wheel)
            gains.append(float(values[rest] @ np.linalg.pinv(covariance[np.ix_(rest, rest)]) @ values[rest]))
        return min(gains) < quantile(len(values) * (wheels - 1) // wheels, THRESHOLDS.single_test_level)

    def confirmed(self, fit: FleetFit) -> FleetFit:
        """Return the fit without effects that recordings which did not fit them do not confirm, the worst first."""
        while fit.terms:
            margins = [self._transfer_margin(fit, index) for index in range(len(fit.terms))]
            worst = int(np.argmin(margins))
            if margins[worst] >= 0:
                break
            fit = self.equations.fit(without(fit, worst))
        return fit

    def _transfer_margin(self, fit: FleetFit, index: int) -> float:
        """Return by how much a term's Δχ² on recordings that did not fit it passes the share that is asked for.

        Of a gain that the priors alone pay (a parameter need not stray) no recording can give anything back: only what
        the readings gained is asked for. A recording in which another effect has a size that only it tells is not
        asked: without that size, what is left there is that effect.
        """
        equations, rest, term = self.equations, without(fit, index), fit.terms[index]
        if max(len(equations.of_rovers(rovers)) for rovers, _ in term.parts) < FEWEST_TO_CONFIRM:
            return 0.0
        asked = told_by_others(equations, rest)[:, None]
        weights = asked * equations.weights * equations.reductions[:, term.group.columns[0], None]

        def saved(used: Array | None = None) -> Array:
            with_it, less = (equations.fit(terms, used) for terms in (fit.terms, rest))
            return np.asarray(((equations.squares(less) - equations.squares(with_it)) * weights).sum(axis=1))

        came_back = sum(float(fold @ saved(1.0 - fold)) for fold in folds_of(equations))
        loss = THRESHOLDS.coefficient_cost * (fit.spans[index].stop - fit.spans[index].start)
        return came_back + loss - THRESHOLDS.transferred_share * float(saved().sum())


def _one_shape(one: FleetTerm, other: FleetTerm) -> bool:
    """Return whether two terms are no two shapes of one law on the same wheel: the second would mend the first.

    What changes at a date is the same law with another size.
    """
    apart = not (set(one.units.rovers) & set(other.units.rovers) and set(one.units.wheels) & set(other.units.wheels))
    return apart or one.name != other.name or one.group == other.group


STARTS = 5
"""Laws with which a search begins, at most (a choice: computing time; the best two or three differ by a tenth)."""
FURTHER_SHARE = 0.05
"""Share of the Δχ² of the effects on the same rovers that a further one must gain (a choice: a law of the fleet has one
of the grid's shapes, and the best four of a cold gearbox's twelve differ by one to four percent)."""
FEWEST_TO_CONFIRM = 3
"""Recordings of the rovers that share its size, below which no other recording can confirm an effect (a choice)."""


def folds_of(equations: FleetEquations) -> list[Array]:
    """Return the folds, each 1 for its recordings: every fifth of each rover's, in the order of time.

    The first of each rover is in another fold than that of the rover before: a fleet may have one recording of each.
    """
    fold = np.zeros(equations.count, np.int64)
    for rover, recordings in enumerate(equations.recordings_of):
        fold[list(recordings)] = (rover + np.arange(len(recordings))) % THRESHOLDS.folds
    return [(fold == number).astype(np.float64) for number in np.unique(fold)]


def told_by_others(equations: FleetEquations, terms: Sequence[FleetTerm]) -> NDArray[np.bool_]:
    """Return in which recordings each size of these terms acts in a recording of another fold too, (recording,)."""
    found = np.ones(equations.count, np.bool_)
    sizes = [equations.factors(term).any(axis=2) for term in terms]
    acts = np.concatenate(sizes) if sizes else np.zeros((0, equations.count), np.bool_)
    for fold in folds_of(equations):
        out = fold > 0
        alone = ~acts[:, ~out].any(axis=1)
        found[out] = ~acts[alone][:, out].any(axis=0)
    return found


def without(fit: FleetFit, *indices: int) -> tuple[FleetTerm, ...]:
    """Return all terms but these."""
    return tuple(term for index, term in enumerate(fit.terms) if index not in indices)


def relative_size(
    equations: FleetEquations, fit: FleetFit, index: int, active_share: float = THRESHOLDS.active_share
) -> float:
    """Return a term's root mean square where it acts, over the mean magnitude of the channel there.

    It counts as at least `active_share` of the root mean square while it acts; 0: it is told, and nothing is decided.
    """
    term, span = fit.terms[index], fit.spans[index]
    at = list(term.group.columns)
    squares = fourths = readings = mean = 0.0
    for size, factor in zip(fit.coefficients[span].reshape(-1, len(at)), fit.factors[span][:: len(at)], strict=True):
        for i, w in zip(*np.nonzero(factor), strict=True):
            values = factor[i, w] * size
            squares += float(values @ equations.products(i, w, at) @ values)
            fourths += float(values @ values) ** 2 * _fourth(equations, int(i), int(w), at)
            readings += equations.counts[i, w]
            mean += equations.counts[i, w] * equations.sums[int(i)].mean_size
    return active_size(squares, fourths, readings, active_share) / max(mean / max(readings, 1.0), 1e-300)


def _fourth(equations: FleetEquations, recording: int, wheel: int, at: Sequence[int]) -> float:
    """Return the sum of fourth powers of a single column; 0 for several, whose size is their root mean square."""
    sums = equations.sums[recording]
    name = equations.wheels[wheel]
    if len(at) > 1 or name not in sums.wheels:
        return 0.0
    places = sums.places[[group.columns[0] for group in equations.groups].index(at[0])]
    return float(sums.fourth[sums.wheels.index(name), places[0]]) if places else 0.0
