"""The decision: the noise, the shapes that a residual suggests, the named effects, and what stays unexplained."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.late_columns import (
    KINDS,
    SENSOR_DELAY,
    late_inputs,
    late_inputs_on,
    lateness,
    makes_late,
    on_some,
)
from regolithd.calibration.mismatch.regression.blocks import blocks_of_time
from regolithd.calibration.mismatch.regression.groups.candidate_groups import with_candidate
from regolithd.calibration.mismatch.regression.groups.lagged_groups import LAGGED
from regolithd.calibration.mismatch.regression.groups.smooth_groups import with_periodic_terms
from regolithd.calibration.mismatch.regression.residuals import residual_of
from regolithd.calibration.mismatch.selection.best_subsets import (
    best_of_each_smooth_term,
    best_subsets,
    entry_cost,
    passes_entry_test,
)
from regolithd.calibration.mismatch.selection.cross_validation import drop_what_does_not_transfer
from regolithd.calibration.mismatch.selection.noise_estimation import (
    noise_left,
    noise_of_whitened,
    whitened,
)
from regolithd.calibration.mismatch.selection.plausibility.implausible_effects import drop_what_the_implausible_explains
from regolithd.calibration.mismatch.selection.plausibility.pulled_parameters import drop_what_pulls_parameters_out
from regolithd.calibration.mismatch.selection.plausibility.released_parameters import OtherStatement, released
from regolithd.calibration.mismatch.selection.shape_optimisation import with_best_developments
from regolithd.calibration.mismatch.selection.sign_flip_test import entry_threshold
from regolithd.calibration.mismatch.selection.smooth_terms import weigh_against_smooth_terms

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations
    from regolithd.calibration.mismatch.signal.noise_models.noise import NoiseModel

Array = NDArray[np.float64]

UNEXPLAINED = "unexplained"
"""What stands for a curve among the names of an answer."""


@dataclass(frozen=True)
class FitQuality:
    """How well a fit explains the readings, and by how much that it is charged for.

    Attributes
    ----------
    readings: independent ones
    power_left: mean square of what is left of the compared readings
    charged: Δχ² that the fit's terms are charged: by their penalties, and for their entry
    """

    readings: float
    power_left: float
    charged: float

    def evidence_over(self, other: FitQuality) -> float:
        """Return by how much the evidence, in Δχ², is larger than that of another fit to the same readings.

        Both may have simulated other inputs: they are compared by the power of what they leave.
        """
        return self.readings * float(np.log(other.power_left / self.power_left)) + other.charged - self.charged


@dataclass(frozen=True, eq=False)
class Intermittent:
    """A curve over time that stands for what comes and goes, which no curve describes.

    Attributes
    ----------
    term: the curve
    from_s, to_s: begin of the first and end of the last spell
    share_of_residual: the spells' share of the power of what is left without them
    """

    term: Term
    from_s: float
    to_s: float
    share_of_residual: float


@dataclass(frozen=True, eq=False)
class ConfinedLaw:
    """A candidate's law that is more probable in a range of a covariate than a name that holds everywhere.

    Attributes
    ----------
    law: the term that has the law, everywhere
    region: the term that stands for it, unexplained
    """

    law: Term
    region: Term


@dataclass(frozen=True, eq=False)
class Decision:
    """What was decided, and what the inference needs.

    Attributes
    ----------
    equations: with all columns that were made, weighted by the final noise
    noise: estimated beside all that was found
    entry_threshold: score above which an effect was named
    named: fit of the named effects
    unnamed: smooth terms that nothing named explains
    whole: fit of both together
    intermittent: of those of the smooth terms that stand for what comes and goes, when and how much
    refused: answers, by their names, of which one name lowered no held-out error
    confined: laws that were more probable in a range than a name that holds everywhere
    notes: on what was decided
    other_statements: answers in which other parameters were stated wrongly, or none was
    changed_or_moved: for each corrected effect that has changed, or else parameters have (`inference.same_parameters`),
        by how much the first is ahead of the second, in Δχ²
    """

    equations: NormalEquations
    noise: NoiseModel
    entry_threshold: float
    named: Fit
    unnamed: tuple[Term, ...]
    whole: Fit
    intermittent: tuple[Intermittent, ...] = ()
    refused: frozenset[frozenset[str]] = frozenset()
    confined: tuple[ConfinedLaw, ...] = ()
    notes: tuple[str, ...] = ()
    other_statements: tuple[OtherStatement, ...] = ()
    changed_or_moved: Mapping[str, float] = field(default_factory=dict)

    @property
    def late(self) -> tuple[str, float] | None:
        """How the predicted channel is late by a named effect, and by how much [s]; None: it is not."""
        named = [(term.name, self._shape_now(index, term)) for index, term in enumerate(self.named.terms)]
        return lateness(named, self.equations.problem.simulation.channel)

    @property
    def late_on(self) -> tuple[int, ...]:
        """The wheels on which the predicted channel is late by a named effect; empty: on all, or on none."""
        problem = self.equations.problem
        for term in self.named.terms:
            if makes_late(term.name, term.group.shape, problem.simulation.channel):
                return on_some(term.wheels, problem.mask.shape[1])
        return ()

    def _shape_now(self, index: int, term: Term) -> Shape:
        """Return the shape of a named term; of a corrected delay that has changed, with the delay that it has now."""
        if not (term.group.is_change and term.name == SENSOR_DELAY):
            return term.group.shape
        scale = float(self.equations.design.scale[term.group.columns[0]])
        times = 1 + float(self.named.coefficients[self.named.of_term(index)][0]) / scale
        shape = term.group.shape
        return {**shape, **{kind: max(times, 0.0) * float(shape[kind]) for kind in KINDS if kind in shape}}

    @property
    def power_left(self) -> float:
        """Mean square of what is left of the compared readings beside all that was found."""
        return float(np.mean(residual_of(self.equations, self.whole)[self.equations.problem.mask] ** 2))

    def does_without_curves_of(self, other: Decision) -> bool:
        """Return whether names alone explain as much as another decision, but for what its curves have by chance."""
        independent = float(self.equations.problem.mask.sum()) / self.noise.autocorrelation_time
        by_chance = sum(other.equations.penalty(term) for term in other.unnamed)
        return not self.unnamed and independent * (self.power_left / other.power_left - 1) <= by_chance

    def is_as_probable_as(self, other: Decision) -> bool:
        """Return whether another decision leaves less by no more than its further terms are charged."""
        return self.quality.evidence_over(other.quality) >= 0

    @property
    def quality(self) -> FitQuality:
        """How well all that was found explains the readings."""
        terms = self.whole.terms
        charged = entry_cost(self.equations, terms, self.entry_threshold) + sum(map(self.equations.penalty, terms))
        independent = float(self.equations.problem.mask.sum()) / self.noise.autocorrelation_time
        return FitQuality(independent, self.power_left, charged)

    @property
    def is_late_alone(self) -> bool:
        """Whether the predicted channel is late, and nothing else was found but late inputs."""
        return self.late is not None and all(term.name == SENSOR_DELAY for term in self.whole.terms)

    @property
    def has_delay(self) -> bool:
        """Whether a named effect makes a column late."""
        return self.late is not None or bool(self.late_inputs)

    @property
    def late_inputs(self) -> dict[str, float]:
        """Inputs of the simulation that are late by a named effect, and by how much [s]."""
        named = [(term.name, term.group.shape) for term in self.named.terms if not term.group.is_change]
        return late_inputs(named, self.equations.problem.simulation.inputs)

    @property
    def late_inputs_on(self) -> dict[str, tuple[int, ...]]:
        """The wheels, by their indices, of those of the late inputs that are late on some."""
        named = [(term.name, term.group.shape, term.wheels) for term in self.named.terms if not term.group.is_change]
        return late_inputs_on(named, self.equations.problem.mask.shape[1])

    def refused_delays(self, stated: Problem) -> frozenset[str]:
        """Return columns that were searched beside their delays, of which none has a name in the end.

        `stated` is the problem before the search: it has late what a corrected simulation has late.
        """
        named = {str(term.group.shape["late"]) for term in self.named.terms if "late" in term.group.shape}
        return _late_columns(self.equations.problem) - _late_columns(stated) - named


def _late_columns(problem: Problem) -> frozenset[str]:
    """Return the columns that a problem has late."""
    return frozenset((*problem.on_time, *([problem.simulation.channel] if problem.late else [])))


def decide(equations: NormalEquations, candidates: Sequence[Candidate]) -> Decision:
    """Choose the named effects, and the smooth terms that nothing named explains."""
    problem = equations.problem
    left = noise_left(with_sines(equations))
    equations = whitened(equations, left)
    threshold = entry_threshold(equations, left, blocks_of_time(problem, noise_of_whitened(equations.design, left)))
    equations = with_proposed_shapes(equations, candidates, left)
    equations, subsets = best_subsets(equations)
    equations, terms = with_best_developments(equations, _largest_that_passes(equations, subsets, threshold).terms)
    named = equations.fit(terms)
    named = drop_what_pulls_parameters_out(equations, named)
    named = drop_what_the_implausible_explains(equations, named, threshold)
    named = drop_what_does_not_transfer(equations, named, threshold)
    simpler = [fit for fit in subsets[1:] if len(fit.terms) < len(named.terms)]
    chosen = named
    named, unnamed = weigh_against_smooth_terms(equations, chosen, simpler, threshold)
    kept = chosen if unnamed else named
    whole = equations.fit((*named.terms, *unnamed))
    freed, other_statements = released(equations, kept, whole, threshold)
    if freed is not None:
        (equations, named), unnamed = freed, ()
        whole = named
    equations, noise = _beside_all_found(equations, whole)
    return Decision(
        equations=equations,
        noise=noise,
        entry_threshold=threshold,
        named=equations.fit(named.terms),
        unnamed=unnamed,
        whole=equations.fit((*named.terms, *unnamed)),
        other_statements=other_statements,
    )


def _beside_all_found(equations: NormalEquations, whole: Fit) -> tuple[NormalEquations, NoiseModel]:
    """Return the equations weighted by the noise that all that was found leaves, and that noise."""
    left = residual_of(equations, whole)
    weights = noise_of_whitened(equations.design, left).weights
    return equations.weighted(weights), equations.problem.noise_of(left)


def as_if_late(decision: Decision) -> Decision | None:
    """Return a decision with the best delay in the place of an unexplained past of the prediction; None: there is none.

    Parameters that were fitted without a delay may stand for a part of it; the rest has not the form of a delay there.
    Where the simulation is linearised beside the delay, it has.
    """
    equations = decision.equations
    delays = [group for group in equations.design.groups if group.named and group.name == SENSOR_DELAY]
    if decision.has_delay or not delays or not any(term.name in LAGGED for term in decision.unnamed):
        return None
    best = equations.gains(decision.named.terms, delays).largest_score()
    if best is None:
        return None
    fit = equations.fit((*decision.named.terms, best[1]))
    return replace(decision, named=fit, unnamed=(), whole=fit)


def names_of(decision: Decision) -> frozenset[str]:
    """Return the names of a decision, and `UNEXPLAINED` for its curves."""
    return answer_names(decision.whole.terms)


def answer_names(terms: Sequence[Term]) -> frozenset[str]:
    """Return the names of terms, and `UNEXPLAINED` for curves."""
    return frozenset(term.name if term.group.named else UNEXPLAINED for term in terms)


def without_name(decision: Decision, index: int) -> Decision:
    """Return the decision without one of its named effects, which held-out readings refused.

    What it leaves is held against the smooth terms again, by the noise beside the best of these: beside the name it has
    in it what the name did not explain.
    """
    threshold, refused = decision.entry_threshold, decision.refused | {names_of(decision)}
    equations, kept = decision.equations, decision.named.without(index)
    curve = [term for _, term in best_of_each_smooth_term(equations, kept)[:1]]
    equations, _ = _beside_all_found(equations, equations.fit((*kept, *curve)))
    named, unnamed = weigh_against_smooth_terms(equations, equations.fit(kept), (), threshold)
    equations, noise = _beside_all_found(equations, equations.fit((*named.terms, *unnamed)))
    named, whole = equations.fit(named.terms), equations.fit((*named.terms, *unnamed))
    return replace(
        decision, equations=equations, noise=noise, named=named, unnamed=unnamed, whole=whole, refused=refused
    )


def _largest_that_passes(equations: NormalEquations, subsets: Sequence[Fit], threshold: float) -> Fit:
    """Return the last set, from the empty one upwards, that passes the entry test against the one before."""
    named = subsets[0]
    for fit in subsets[1:]:
        if passes_entry_test(equations, fit, named, threshold):
            named = fit
    return named


def with_sines(equations: NormalEquations) -> NormalEquations:
    """Return equations with the strongest sines in what the free parameters leave: one that stays in is slow noise."""
    return equations.over(with_periodic_terms(equations.design, residual_of(equations, equations.fit(()))))


def with_proposed_shapes(equations: NormalEquations, candidates: Sequence[Candidate], left: Array) -> NormalEquations:
    """Return equations with the shapes and the sines over time that the residual of the free parameters suggests.

    And with those shapes that stand out of what is `left` (time, wheel) beside all that is significant, and that larger
    effects hide.
    """
    problem = equations.problem
    residual = residual_of(equations, equations.fit(()))
    design, white = equations.design, equations.design.whitened_in_time(residual)
    autocorrelation_time = _autocorrelation_time(equations, white)
    for candidate in candidates:
        shapes = [shape for each in (residual, left) for shape in candidate.propose_shapes(problem, each)]
        if shapes := [shape for place, shape in enumerate(shapes) if shape not in shapes[:place]]:
            reductions = [
                max(autocorrelation_time / candidate.autocorrelation_time_at(problem, white, shape), 1.0)
                for shape in shapes
            ]
            design, _ = with_candidate(design, candidate, shapes, reductions)
    return equations.over(with_periodic_terms(design, residual))


def _autocorrelation_time(equations: NormalEquations, white: Array) -> float:
    """Return the autocorrelation time that the weights imply for a whitened residual [time, wheel]."""
    counts = np.maximum(equations.problem.mask.sum(axis=0), 1)
    return float(np.median(counts / np.maximum(equations.weights * np.sum(white**2, axis=0), 1e-300)))
