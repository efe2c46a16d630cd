"""Effects that a corrected simulation has already: in its prediction, with a prior, and what changed of them.

The size of each is a free parameter held by its own standard deviation, so that a recording which agrees is consistent.
What lies further away than that is named as a change of this effect: more, less or gone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.answer import Change
from regolithd.calibration.mismatch.candidates.candidate import SHAPE_TOLERANCE, Candidate, Coefficient, Shape
from regolithd.calibration.mismatch.candidates.late_columns import (
    columns_of,
    late_inputs,
    late_inputs_on,
    lateness,
    makes_late,
    on_some,
)
from regolithd.calibration.mismatch.candidates.motion import REVERSAL_KEYS
from regolithd.calibration.mismatch.candidates.reversal import reversal_of
from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.empirical.stated import EmpiricalCurveLaw
from regolithd.calibration.mismatch.errors import SimulationError, did_you_mean
from regolithd.calibration.mismatch.inference.rounding import with_interval
from regolithd.calibration.mismatch.inference.statements import after_number, on_wheels
from regolithd.calibration.mismatch.problem.corrections.onset_clock import is_later, on_the_clock_of
from regolithd.calibration.mismatch.problem.problem import StatedEffect
from regolithd.calibration.mismatch.problem.words import in_units, in_words

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from regolithd.calibration.mismatch.answer import Parameter
    from regolithd.calibration.mismatch.problem.corrections.empirical_curve import StatedCurve
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]
Wheels = tuple[int | str, ...]

RELATIVE_CHANGE = "relative_change"
"""The change's coefficient: 0 is unchanged, 1 twice as large, −1 gone."""
SECANT_CHANGE = "secant_change"
"""The relative change over which a law that is not linear in its size is differenced; −1 is the whole effect."""
SECANT_CHANGES = (-1.0, 0.5, 2.0)
"""The grid of it: gone, half as large again and three times as large (a choice: the fitted change is iterated)."""
SMALLEST_CHANGE, LARGEST_CHANGE = 0.05, 10.0
"""Range of its size (a choice: a smaller change is linear, and an effect eleven times as large is another one)."""


@dataclass(frozen=True)
class Stated:
    """An effect as it was corrected, and the candidate that it is of."""

    candidate: Candidate
    contribution: Contribution
    in_simulation: bool

    def column(self, problem: Problem, times: float = 1.0) -> Array:
        """Return what it adds to the prediction, so many times as large as it was corrected, shape (time, wheel).

        Parameters
        ----------
        problem: without any stated effect in its prediction
        times: factor on the coefficients

        Raises
        ------
        SimulationError
            When the recording has not what the effect depends on, or the effect's shape or coefficients are incomplete.
        """
        found = times * np.array(self.contribution.coefficients, np.float64)
        columns = np.where(problem.mask, self._columns(problem, found.tolist()), 0.0)
        on = np.isin(np.array(problem.recording.wheels, dtype=object), list(self.contribution.wheels))
        if len(found) != len(columns):
            raise SimulationError(
                f"[[effects]] {self.contribution.name}: {len(columns)} coefficients are needed, not {len(found)}"
            )
        coefficients = self.candidate.coefficients_here(problem, self.contribution.shape, found.tolist())
        return np.einsum("c,ctw,w->tw", coefficients, columns, on)

    def deviations(self, problem: Problem) -> tuple[Array, ...]:
        """Return what one standard deviation of each number in the law, other than its size, adds to the prediction."""
        if isinstance(self.candidate, EmpiricalCurveLaw):
            return tuple(self.candidate.deviations(problem))
        return tuple(self._deviation(problem, name, std) for name, std in self.contribution.shape_std.items())

    def _deviation(self, problem: Problem, name: str, std: float) -> Array:
        """Return what one standard deviation of a shape parameter adds beside a change of the effect's size."""
        least, most = {**self.candidate.refined, **self.candidate.free}.get(name, (-np.inf, np.inf))
        at = float(self.contribution.shape[name])
        low, high = (float(np.clip(at + far, least, most)) for far in (-std, std))
        ends = [
            replace(self, contribution=replace(self.contribution, shape={**self.contribution.shape, name: value}))
            for value in (low, high)
        ]
        slope = (ends[1].column(problem) - ends[0].column(problem)) / max(high - low, 1e-300)
        column = self.column(problem)
        along = float(np.vdot(column, slope)) / max(float(np.vdot(column, column)), 1e-300)
        return std * (slope - along * column)

    def bent(self, problem: Problem) -> bool:
        """Return whether the law is not linear in its size: twice the coefficients would ask for another shape."""
        shape, twice = self.contribution.shape, [2 * value for value in self.contribution.coefficients]
        return self.candidate.self_consistent_shape(problem, shape, twice) != shape

    def shape(self, problem: Problem) -> Shape:
        """Return the shape as corrected, with the reversal of the friction that this recording shows, if it does.

        How gradually friction reverses is found once for a recording, for every law that reverses.
        """
        here = {} if self.in_simulation else reversal_of(problem)
        reverses = here and any(not REVERSAL_KEYS.keys().isdisjoint(shape) for shape in self.candidate.shapes(problem))
        as_corrected = self.contribution.shape
        if not reverses:
            return as_corrected
        return {**{key: value for key, value in as_corrected.items() if key not in REVERSAL_KEYS}, **here}

    def _columns(self, problem: Problem, coefficients: Sequence[float]) -> Array:
        """Return the candidate's columns; what never varies in this recording, a level drive's pitch, counts too."""
        known = replace(problem, covariates={**problem.constants, **problem.covariates})
        name, shape = self.contribution.name, self.shape(known)
        if lacking := [covariate for covariate in self.candidate.requires if covariate not in known.covariates]:
            raise SimulationError(
                f"[[effects]] {name} depends on {', '.join(lacking)}, which this recording does not have: "
                "record it, or take the effect out of the file"
            )
        try:
            known = on_the_clock_of(known, self.contribution.found_in)
            return columns_of(known, self.candidate, self.candidate.self_consistent_shape(known, shape, coefficients))
        except KeyError as error:
            raise SimulationError(
                f"[[effects]] {name}: its shape lacks {error}; find the effect again with --corrected"
            ) from error


class ChangedSize(Candidate):
    """A relative change of an effect that the simulation was corrected by."""

    coefficients: ClassVar = (Coefficient(RELATIVE_CHANGE, "1", 0),)
    stated_size = 1.0
    late_with_channel = False  # its columns are made as shown

    def __init__(self, stated: Stated, place: int, acts_as: Candidate | None) -> None:
        """Make a change of the effect in this place of `problem.stated`; `acts_as` None: it depends on nothing here."""
        of, like = stated.candidate, acts_as or stated.candidate
        self.stated, self.place = stated, place
        for name in ("name", "equation", "source", "label", "along_motion"):
            setattr(self, name, getattr(of, name))
        self.covariate, self.imitated_over = (like.covariate, like.imitated_over) if acts_as else ("none", "none")  # type: ignore[misc]
        self.signature = like.signature  # type: ignore[misc]
        self.experiment, self.experiment_one_way = like.experiment, like.experiment_one_way  # type: ignore[misc]
        self.vary, self.run_unloaded = like.vary, like.run_unloaded  # type: ignore[misc]
        self.words = f"a change of a corrected effect: {of.words}"  # type: ignore[misc]
        self.sharing = ("one",) if len(stated.contribution.wheels) == 1 else of.sharing  # type: ignore[misc]
        self.channel = of.channel  # type: ignore[misc]
        self.acts_unloaded = of.acts_unloaded  # type: ignore[misc]

    def applies(self, problem: Problem) -> bool:
        """Return whether the effect can act in this recording at all."""
        return bool(np.any(problem.stated[self.place].column))

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Return the shape that was corrected; of a law that is not linear in its size, over several changes of it."""
        shape = dict(self.stated.contribution.shape)
        if self.stated.in_simulation or not self.stated.bent(problem):
            return [shape]
        return [{**shape, SECANT_CHANGE: change} for change in SECANT_CHANGES]

    def shape_count(self, problem: Problem) -> float:  # noqa: ARG002
        """Return 1: the change that a secant is taken over is the coefficient itself, and no choice beside it."""
        return 1

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return the effect's change per relative change of its size, from the prediction without stated effects."""
        column = problem.stated[self.place].column
        change = float(shape.get(SECANT_CHANGE, -1.0))
        if change == -1.0:
            return column[None]
        before = replace(problem, prediction=problem.prediction - problem.added, stated=())
        return ((self.stated.column(before, 1 + change) - column) / change)[None]

    def self_consistent_shape(self, problem: Problem, shape: Shape, values: Sequence[float]) -> Shape:  # noqa: ARG002
        """Return the shape with the secant over the fitted change."""
        if SECANT_CHANGE not in shape:
            return shape
        change = float(np.clip(values[0], -1.0, LARGEST_CHANGE))
        change = float(np.copysign(max(abs(change), SMALLEST_CHANGE), change))
        before = float(shape[SECANT_CHANGE])
        return shape if abs(change - before) < SHAPE_TOLERANCE * abs(before) else {**shape, SECANT_CHANGE: change}


def stated_in(
    candidates: Sequence[Candidate],
    effects: Sequence[Contribution],
    in_simulation: Sequence[Contribution],
    curves: Sequence[StatedCurve] = (),
) -> tuple[Stated, ...]:
    """Return the effects that a simulation has: those to add on its output, those that it predicts itself, and curves.

    Raises
    ------
    SimulationError
        When there is no candidate of an effect's name.
    """
    known = {candidate.name: candidate for candidate in candidates}
    found = []
    for inside, listed in ((False, _merged(effects)), (True, _merged(in_simulation))):
        for effect in listed:
            if effect.name not in known:
                place = "stated_effects" if inside else "[[effects]]"
                raise SimulationError(
                    f"{place} has {effect.name}, which is not looked for with this simulation, so that no change of it "
                    f"would be seen; {did_you_mean(effect.name, sorted(known))}"
                )
            found.append(Stated(known[effect.name], effect, inside))
    laws = [EmpiricalCurveLaw(curve) for curve in curves]
    found += [Stated(law, Contribution(law.name, {}, (1.0,), law.stated.wheels), in_simulation=False) for law in laws]
    return tuple(found)


def _merged(effects: Sequence[Contribution]) -> list[Contribution]:
    """Return the effects with those of one name and shape summed on each wheel: a correction of a correction.

    An effect of which a part of the wheels was corrected again is one on these, and one on the others.
    """
    alike: dict[tuple[str, str], list[Contribution]] = {}
    for effect in effects:
        key = effect.name, repr((sorted(effect.shape.items(), key=str), effect.found_in))
        alike.setdefault(key, []).append(effect)
    return [part for several in alike.values() for part in _summed_on_wheels(several)]


def _summed_on_wheels(effects: Sequence[Contribution]) -> list[Contribution]:
    """Return effects of one name and shape, each on wheels of its own."""
    acting: dict[int | str, tuple[int, ...]] = {}
    for place, effect in enumerate(effects):
        for wheel in effect.wheels:
            acting[wheel] = (*acting.get(wheel, ()), place)
    on: dict[tuple[int, ...], list[int | str]] = {}
    for wheel, places in acting.items():
        on.setdefault(places, []).append(wheel)
    return [replace(_summed([effects[k] for k in places]), wheels=tuple(wheels)) for places, wheels in on.items()]


def _summed(effects: Sequence[Contribution]) -> Contribution:
    """Return the sum of effects of one name and shape, with the spread of all their sizes."""
    if len(effects) == 1:
        return effects[0]
    total = np.sum([each.coefficients for each in effects], axis=0)
    spread = np.hypot.reduce([each.relative_std * float(np.linalg.norm(each.coefficients)) for each in effects])
    relative = float(spread) / max(float(np.linalg.norm(total)), 1e-300)
    return replace(effects[0], coefficients=tuple(total.tolist()), relative_std=relative, posterior=None)


def corrected_problem(problem: Problem, stated: Sequence[Stated]) -> Problem:
    """Return the problem whose prediction has the effects, with how well the size of each is known."""
    known = [(each.contribution.name, each.contribution.shape) for each in stated]
    recording = problem.recording.with_notes(*_notes_on_wheels(stated, problem.recording.wheels))
    channel, wheels = problem.simulation.channel, problem.recording.wheels
    on = [each.contribution.wheels for each, effect in zip(stated, known, strict=True) if makes_late(*effect, channel)]
    late_on = on_some([wheels.index(wheel) for wheel in on[0] if wheel in wheels], len(wheels)) if on else ()
    problem = replace(problem, recording=recording, late=lateness(known, channel), late_on=late_on)
    effects = tuple(
        StatedEffect(
            name=each.contribution.name,
            wheels=each.contribution.wheels,
            column=each.column(problem),
            relative_std=each.contribution.relative_std,
            in_simulation=each.in_simulation,
            on_time=not each.in_simulation and each.contribution.shape.get("late") in problem.on_time,
            deviations=each.deviations(problem),
            posterior=each.contribution.posterior,
        )
        for each in stated
    )
    added = replace(problem, stated=effects).added
    return replace(problem, stated=effects, prediction=problem.prediction + added)


def _notes_on_wheels(stated: Sequence[Stated], wheels: Sequence[int | str]) -> Iterator[str]:
    """Yield a note on each effect that is stated for a wheel which the recording does not have."""
    for each in stated:
        for name in each.contribution.wheels:
            if name not in wheels:
                near = did_you_mean(str(name), map(str, wheels))
                yield f"{each.contribution.name} is corrected on {name}, which the recording does not have: {near}"


def stated_late_inputs(stated: Sequence[Stated], inputs: Sequence[str]) -> dict[str, float]:
    """Return which of these inputs a corrected simulation has on time, and by how much they are recorded late [s]."""
    return late_inputs(
        [(each.contribution.name, each.contribution.shape) for each in stated if not each.in_simulation], inputs
    )


def stated_late_inputs_on(stated: Sequence[Stated], wheels: Sequence[int | str]) -> dict[str, tuple[int, ...]]:
    """Return the wheels, by their indices, of those late inputs that a corrected simulation has late on some."""
    effects = [each.contribution for each in stated if not each.in_simulation]
    places = [[k for k, wheel in enumerate(wheels) if wheel in each.wheels] for each in effects]
    return late_inputs_on([(each.name, each.shape, on) for each, on in zip(effects, places, strict=True)], len(wheels))


def with_changes(problem: Problem, candidates: Sequence[Candidate], stated: Sequence[Stated]) -> tuple[Candidate, ...]:
    """Return the candidates, with a change of each stated effect in the place of the effect itself.

    Where an effect is on some wheels alone, it is still looked for on the others; a delay in other columns. One that
    had begun before this recording acts as what it is `once_begun`, and may begin another time.
    """
    measured = {name for k, name in enumerate(problem.recording.wheels) if problem.mask[:, k].any()}
    covered: dict[str, list[Shape]] = {}
    changes = []
    for place, each in enumerate(stated):
        acts_as: Candidate | None = each.candidate
        if is_later(problem, each.contribution.found_in):
            acts_as = next((other for other in candidates if other.name == each.candidate.once_begun), None)
        if acts_as and measured <= set(each.contribution.wheels):
            covered.setdefault(acts_as.name, []).append(each.contribution.shape)
        changes.append(ChangedSize(each, place, acts_as))
    beside = [each.beside(covered[each.name]) if each.name in covered else each for each in candidates]
    return (*(candidate for candidate in beside if candidate is not None), *changes)


def contribution_of_change(change: ChangedSize, relative_change: float, wheels: Wheels) -> Contribution:
    """Return what a corrected simulation has to add for the change, on those of these wheels that have the effect."""
    of = change.stated.contribution
    if all(each.sign for each in change.stated.candidate.coefficients):
        relative_change = max(relative_change, -1.0)  # what has one sign alone is nothing at least
    coefficients = tuple(relative_change * value for value in of.coefficients)
    changed = _both(of.wheels, wheels)
    return replace(of, coefficients=coefficients, wheels=changed, relative_std=0.0, posterior=None)


def changes_of(
    change: ChangedSize, parameters: Mapping[str, Parameter], problem: Problem, wheels: Wheels
) -> tuple[Change, ...]:
    """Return, for each coefficient of the effect, what was corrected and what it is now, on wheels where it changed."""
    of, candidate = change.stated.contribution, change.stated.candidate
    changed = _both(of.wheels, wheels)
    relative, simulation = parameters[RELATIVE_CHANGE], problem.simulation
    named = candidate.parameters(of.shape, list(of.coefficients))
    found = []
    for coefficient in candidate.coefficients[: len(of.coefficients)]:
        if coefficient.name not in named:
            continue
        value = named[coefficient.name]
        now, *ends = (value * (1 + each) for each in (relative.value, relative.low, relative.high))
        if coefficient.sign:  # what has one sign alone is nothing at least
            now, *ends = (max(each * coefficient.sign, 0.0) * coefficient.sign for each in (now, *ends))
        low, high = sorted(ends)
        told = Change(
            name=of.name,
            parameter=coefficient.name,
            corrected=value,
            now=now,
            low=low,
            high=high,
            unit=in_units(coefficient.unit, simulation.unit, problem.labels),
            channel=simulation.channel,
            wheels=changed,
        )
        where = on_wheels(changed, len(problem.recording.wheels), simulation.wheel_column)
        of_curve = isinstance(candidate, EmpiricalCurveLaw)
        subject = in_words(f"the {candidate.label}", problem.labels) if of_curve else of.name
        found.append(replace(told, statement=change_in_words(told, where, subject)))
    return tuple(found)


def _both(one: Wheels, other: Wheels) -> Wheels:
    """Return the wheels that are in both."""
    return tuple(wheel for wheel in one if wheel in other)


def direction_of(change: Change) -> Literal["gone", "larger", "smaller"]:
    """Return what became of a corrected effect: what is smaller, and may be nothing by its interval, is gone."""
    if not abs(change.now) < abs(change.corrected):
        return "larger"
    return "gone" if min(change.low, change.high) <= 0 <= max(change.low, change.high) else "smaller"


def change_in_words(change: Change, where: str, subject: str) -> str:
    """Return one sentence about a change of a subject; `where` is ', on ' and the wheels, empty of one alone."""
    direction, unit = direction_of(change), after_number(change.unit)
    now, low, high = with_interval(change.now, change.low, change.high)
    told = "gone" if direction == "gone" else f"{direction} than the corrected simulation has it"
    return (
        f"{subject} is {told}{where}: {change.parameter} from {change.corrected:.4g} to {now}{unit} "
        f"(90 % sure: {low} to {high})."
    )
