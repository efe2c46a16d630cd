"""The search over a fleet: which candidates, on which wheels of which rovers, since when.

Effects are chosen one after the other; after each, every chosen one is searched anew beside the others. A term pays for
its coefficients, and for having been chosen among shapes, rovers, wheels and dates (2 ln of their numbers).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from math import comb
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.fleet.choice.courses import Course, courses_over
from regolithd.calibration.mismatch.fleet.choice.terms import FleetTerm, Units
from regolithd.calibration.mismatch.regression.screening.schur import (
    delta_chi2_of_each,
    delta_chi2_together,
    schur_diagonal,
)
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit
    from regolithd.calibration.mismatch.fleet.work.grid import GridGroup

Array = NDArray[np.float64]

MOST_TERMS = 24
"""Effects of a fleet at most (a choice: computing time)."""
ALWAYS = Course("always")
TRIED = 12
"""Best terms that are tried for each further effect (a choice: the best may be implausible or too small)."""


@dataclass(frozen=True, eq=False)
class Place:
    """A set of units with the courses that an effect may have there, and what all columns still explain there.

    Attributes
    ----------
    units, recordings: where; in the order of time
    begins, stands: courses of what is a change by its nature, and of what is not
    """

    units: Units
    recordings: tuple[int, ...]
    begins: tuple[Course, ...]
    stands: tuple[Course, ...]

    def courses(self, group: GridGroup) -> tuple[Course, ...]:
        """Return the courses of a candidate."""
        return self.begins if group.begins else self.stands


def places_of(equations: FleetEquations) -> list[Place]:
    """Return all sets of units: the fleet and each rover, with all of their wheels, single ones and sets of them."""
    count = len(equations.recordings_of)
    of = [(rover,) for rover in range(count)]
    wheels = tuple(range(len(equations.wheels)))
    sets = []
    for rovers in [tuple(range(count)), *of] if count > 1 else of:
        sets.append(Units(rovers, wheels))
        if len(wheels) > 1:
            sets += [Units(rovers, (wheel,), "one") for wheel in wheels]
            sets += [Units(rovers, some, "some") for some in sorted(_wheel_sets(equations))]
    return [place_of(equations, units) for units in sets]


def place_of(equations: FleetEquations, units: Units) -> Place:
    """Return a set of units with the courses that an effect may have there."""
    at = equations.of_rovers(units.rovers)
    begins, stands = (_told_apart(equations, units, courses_over(at, begins=kind)) for kind in (True, False))
    return Place(units, at, begins, stands)


def _told_apart(equations: FleetEquations, units: Units, courses: Sequence[Course]) -> tuple[Course, ...]:
    """Return the courses whose date every rover has seen: else a rover that came later would look like a date."""
    found = []
    for course in courses:
        when = equations.when[course.first]
        seen = [
            equations.when[at[0]] < when <= equations.when[at[-1]]
            for at in (list(equations.recordings_of[rover]) for rover in units.rovers)
        ]
        if course.kind == "always" or all(seen):
            found.append(course)
    return tuple(found)


def _wheel_sets(equations: FleetEquations) -> set[tuple[int, ...]]:
    found = set()
    for sums in equations.sums:
        for some in sums.wheel_sets:
            found.add(tuple(equations.wheels.index(sums.wheels[w]) for w in some))
    return {some for some in found if 1 < len(some) < len(equations.wheels)}


def penalty(equations: FleetEquations, term: FleetTerm, thresholds: Thresholds = THRESHOLDS) -> float:
    """Return what a term has to gain beyond chance, in Δχ²."""
    group, units = term.group, term.units
    total = thresholds.coefficient_penalty * len(group.columns) * len(term.parts) + 2 * float(np.log(group.tried))
    total += _implausibility(equations, group)
    total += course_cost(term.course)
    if term.course.kind != "always":
        total += 2 * float(np.log(len(courses_over(equations.of_rovers(units.rovers), begins=group.begins))))
    choices = comb(len(equations.recordings_of), len(units.rovers))
    if units.sharing != "all":
        choices *= len(equations.wheels)
        total += thresholds.single_wheel_penalty if "all" in group.candidate.sharing else 0.0
    total += 2 * float(np.log(2 * choices)) if choices > 1 else 0.0
    return total


def course_cost(course: Course, thresholds: Thresholds = THRESHOLDS) -> float:
    """Return what growth has to gain beyond a step, in Δχ²: its power, as any number of a law that is no usual one."""
    return thresholds.lead_margin if course.kind == "growing" else 0.0


def _implausibility(equations: FleetEquations, group: GridGroup) -> float:
    return equations.implausibility[group.columns[0]]


def score(equations: FleetEquations, fit: FleetFit) -> float:
    """Return Δχ² less penalties."""
    return fit.delta_chi2 - sum(penalty(equations, term) for term in fit.terms)


def may_share(group: GridGroup, units: Units, wheel_count: int) -> bool:
    """Return whether a candidate may be on such units; where a machine has one wheel, on that."""
    sharing = group.candidate.sharing
    if units.sharing == "one":
        return "one" in sharing
    if units.sharing == "some":
        return len(sharing) > 1
    return "all" in sharing or wheel_count == 1


def further(
    equations: FleetEquations, fit: FleetFit, places: Sequence[Place], groups: Sequence[GridGroup] | None = None
) -> list[tuple[float, FleetTerm]]:
    """Return the best further term of each name on each set of units, with Δχ² less penalty, best first.

    `groups` are those that are searched; None: those that have a name.
    """
    left = equations.left_moment(fit)
    best: list[tuple[float, FleetTerm]] = []
    for place in places:
        allowed = [
            group
            for group in (equations.named_groups if groups is None else groups)
            if may_share(group, place.units, len(equations.wheels)) and place.courses(group)
        ]
        of_name: dict[str, tuple[float, FleetTerm]] = {}
        for gain, term in _gains(equations, fit, left, place, allowed):
            least = of_name[term.name][0] if term.name in of_name else -np.inf
            if gain > max(least, 0.0) and (value := gain - penalty(equations, term)) > least:  # a penalty is never < 0
                of_name[term.name] = (value, term)
        best += of_name.values()
    return sorted(best, key=lambda pair: -pair[0])


def _gains(
    equations: FleetEquations, fit: FleetFit, left: Array, place: Place, groups: Sequence[GridGroup]
) -> Iterator[tuple[float, FleetTerm]]:
    """Yield the best course of each group on a set of units, with its Δχ²."""
    summed = summed_over(equations, fit, left, place)
    for courses, of_courses in ((place.begins, True), (place.stands, False)):
        chosen = [group for group in groups if group.begins == of_courses]
        if not chosen or not courses:
            continue
        by = np.stack([course.factors(place.recordings, equations.when) for course in courses])
        costs = np.array([course_cost(course) for course in courses])
        together = [len(group.columns) > 1 or group.of_wheels for group in chosen]
        single = [group for group, several in zip(chosen, together, strict=True) if not several]
        if single:
            of_single = summed.gains_of_single(by, single)
            for group, gains, top in zip(
                single, of_single.T, np.argmax(of_single - costs[:, None], axis=0), strict=True
            ):
                yield float(gains[top]), FleetTerm(group, place.units, courses[top])
        for group in itertools.compress(chosen, together):
            gains = _own_gains(equations, left, place, group, by) if group.of_wheels else summed.gains(by, group)
            top = int(np.argmax(gains - costs))
            yield float(gains[top]), FleetTerm(group, place.units, courses[top])


def _own_gains(equations: FleetEquations, left: Array, place: Place, group: GridGroup, by: Array) -> Array:
    """Return the Δχ² of a group whose coefficients are each wheel's own, with each course, shape (course,).

    Parameters stay: its columns are in no direction of theirs, or it gains more than this.
    """
    at, total = list(group.columns), np.zeros(len(by))
    for rovers, (wheel,) in FleetTerm(group, place.units, ALWAYS).parts:
        here = np.isin(equations.rover[list(place.recordings)], rovers)
        recordings = np.array(place.recordings)[here]
        moment = by[:, here] @ left[recordings, wheel][:, at]
        energies = np.array([equations.known(i, wheel, at) for i in recordings.tolist()])
        own = np.einsum("icd,mi->mcd", energies, by[:, here] ** 2)
        inverse = np.linalg.pinv(own, rcond=THRESHOLDS.least_tolerance, hermitian=True)
        total += np.einsum("mc,mcd,md->m", moment, inverse, moment)
    return total


@dataclass(frozen=True, eq=False)
class Summed:
    """Sums over the wheels of a set of units, by recording.

    Attributes
    ----------
    left: shape (recording, column)
    own: sums of products by what columns know, shape (recording, column, column)
    cross: the same of fitted coefficients with all columns, shape (coefficient, recording, column)
    inverse: of the fitted coefficients that act here
    """

    left: Array
    own: Array
    cross: Array
    inverse: Array

    def gains(self, by: Array, group: GridGroup) -> Array:
        """Return the Δχ² of a group with each course, shape (course,); `by` is (course, recording)."""
        at = list(group.columns)
        moment = by @ self.left[:, at]
        cross = np.tensordot(by, self.cross[:, :, at], axes=(1, 1))
        own = np.tensordot(by**2, self.own[:, at][:, :, at], axes=(1, 0))
        complement = own - np.swapaxes(cross, 1, 2) @ (self.inverse @ cross)
        least, signs = THRESHOLDS.least_tolerance, group.signs
        largest = np.max(np.diagonal(own, axis1=1, axis2=2), axis=1)
        return np.array(
            [
                delta_chi2_together(m, c, float(most), signs, least) if most > 0 else 0.0
                for m, c, most in zip(moment, complement, largest, strict=True)
            ]
        )

    def gains_of_single(self, by: Array, groups: Sequence[GridGroup]) -> Array:
        """Return the Δχ² of groups of one column each with each course, shape (course, group)."""
        at = [group.columns[0] for group in groups]
        signs = np.array([group.signs[0] for group in groups])
        moment = by @ self.left[:, at]
        cross = np.asarray(np.tensordot(by, self.cross[:, :, at], axes=(1, 1)), np.float64)
        own = by**2 @ self.own[:, at, at]
        complement = schur_diagonal(own, cross, self.inverse)
        return delta_chi2_of_each(moment, complement, own, signs, THRESHOLDS.least_tolerance)


def summed_over(equations: FleetEquations, fit: FleetFit, left: Array, place: Place) -> Summed:
    """Return the sums over the wheels of a set of units."""
    at, on = list(place.recordings), list(place.units.wheels)
    acting = np.flatnonzero(fit.factors[:, at].any(axis=(1, 2)))
    cross = np.zeros((len(acting), len(at), equations.gram.shape[-1]))
    own = np.zeros((len(at), *equations.gram.shape[-2:]))
    for place_of, i in enumerate(at):
        root = np.sqrt(equations.reductions[i])
        for w in on:
            factor = fit.factors[acting, i, w] * root[fit.columns[acting]]
            cross[:, place_of] += factor[:, None] * equations.gram[i, w][fit.columns[acting]]
            own[place_of] += equations.gram[i, w]
        cross[:, place_of] *= root
        own[place_of] *= np.outer(root, root)
    return Summed(
        left=left[at][:, on].sum(axis=1), own=own, cross=cross, inverse=fit.covariance[np.ix_(acting, acting)]
    )
