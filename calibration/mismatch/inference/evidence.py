"""The arrays behind an answer: residuals over time and over each covariate, parameters, and the terms to add."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.answer import Curve, EmpiricalFit, Evidence
from regolithd.calibration.mismatch.candidates.candidate import Candidate
from regolithd.calibration.mismatch.changes import ChangedSize, contribution_of_change
from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.problem.corrections.empirical_curve import StatedCurve
from regolithd.calibration.mismatch.problem.corrections.onset_clock import found_here
from regolithd.calibration.mismatch.regression.blocks import blocks_of_time
from regolithd.calibration.mismatch.regression.groups.smooth_groups import has_smooth_term
from regolithd.calibration.mismatch.regression.residuals import residual_of
from regolithd.calibration.mismatch.signal.binning import binned_means, even_edges

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.empirical.found import FoundCurve
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations
    from regolithd.calibration.mismatch.selection.decision import Decision
    from regolithd.calibration.mismatch.signal.noise_models.noise import NoiseModel

Array = NDArray[np.float64]
Index = NDArray[np.int64]

CURVE_BINS = 24
FEWEST_READINGS = 100
"""Readings below which no curve is made."""


def evidence_of(decision: Decision) -> Evidence:
    """Return what a picture of the answer needs."""
    equations, named, noise = decision.equations, decision.named, decision.noise
    problem = equations.problem
    nan = np.where(problem.mask, 0.0, np.nan)
    before, after = (residual_of(equations, fit) + nan for fit in (equations.fit(()), named))
    blocks = blocks_of_time(problem, noise)
    return Evidence(
        channel=problem.simulation.channel,
        unit=problem.simulation.unit,
        time_s=problem.time_s[:, 0],
        wheels=problem.recording.wheels,
        measured=problem.measured,
        before=problem.measured - before,
        after=problem.measured - after,
        map_time_s=_block_centres(problem, blocks),
        map_before=_standardised_block_means(problem, noise, before, blocks),
        map_after=_standardised_block_means(problem, noise, after, blocks),
        curves=_curves(decision, before, after),
        values=calibrated_values(equations, named),
        contributions=contributions_of(equations, named),
        problem=problem,
    )


def empirical_fits(decision: Decision, curves: Sequence[FoundCurve]) -> tuple[EmpiricalFit, ...]:
    """Return the curves as a corrected simulation has them, with what was fitted beside each."""
    equations = decision.equations
    channel = equations.problem.simulation.channel
    return tuple(
        EmpiricalFit(
            curve=StatedCurve(
                channel, wheel_names(equations.problem, each.terms[0].wheels), each.terms[0].name, each.curve
            ),
            values=calibrated_values(equations, each.fit),
            contributions=contributions_of(equations, each.fit),
            at=each.points.at,
            mean=each.points.mean,
            standard_error=each.points.standard_error,
            suggested=each.suggested,
        )
        for each in curves
    )


def wheel_names(problem: Problem, wheels: Sequence[int]) -> tuple[int | str, ...]:
    """Return the names of those wheels of which something is known."""
    return tuple(problem.recording.wheels[w] for w in wheels if problem.mask[:, w].any())


def calibrated_values(equations: NormalEquations, fit: Fit) -> dict[str, float]:
    """Return the simulation's parameters, and each wheel's own deviations, as the fit has them."""
    problem, nuisance = equations.problem, equations.nuisance
    shifts = equations.shifts_of_parameters(fit).tolist()
    moved = dict(zip(nuisance.names[: nuisance.count], shifts[: nuisance.count], strict=True))
    known = {name: shift for name, shift in moved.items() if name not in nuisance.stated}
    return {name: problem.values.get(name, 0.0) + known.get(name, 0.0) for name in {**problem.values, **known}}


def contributions_of(equations: NormalEquations, fit: Fit) -> tuple[Contribution, ...]:
    """Return the named terms as a corrected simulation holds them, changes of what it has already last."""
    of_terms = [contribution_of(equations, fit, index) for index in range(len(fit.terms))]
    changed = [isinstance(term.group.candidate, ChangedSize) for term in fit.terms]
    named = [each for each, is_change in zip(of_terms, changed, strict=True) if not is_change]
    return (*named, *(each for each, is_change in zip(of_terms, changed, strict=True) if is_change))


def contribution_of(equations: NormalEquations, fit: Fit, index: int) -> Contribution:
    """Return a named term as a corrected simulation holds it."""
    term, problem = fit.terms[index], equations.problem
    scale = equations.design.scale[list(term.group.columns)]
    coefficients = (fit.coefficients[fit.of_term(index)] / scale).tolist()
    wheels = wheel_names(problem, term.wheels)
    if isinstance(term.group.candidate, ChangedSize):
        return contribution_of_change(term.group.candidate, coefficients[0], wheels)
    contribution = Contribution(term.name, term.group.shape, tuple(coefficients), wheels)
    begins = Candidate.change_point in term.group.shape
    return replace(contribution, found_in=found_here(problem)) if begins else contribution


def _block_centres(problem: Problem, blocks: Index) -> Array:
    count = int(blocks.max()) + 1
    return np.bincount(blocks, problem.time_s[:, 0], count) / np.bincount(blocks, minlength=count)


def _standardised_block_means(problem: Problem, noise: NoiseModel, residual: Array, blocks: Index) -> Array:
    """Return block means of the residual along the motion over their standard errors, shape (block, wheel)."""
    along = problem.covariates.get("direction", np.ones(problem.mask.shape))
    count = int(blocks.max()) + 1
    signed, wheels = np.nan_to_num(residual * along), range(residual.shape[1])
    sums = np.stack([np.bincount(blocks, signed[:, w], count) for w in wheels], axis=1)
    counts = np.stack([np.bincount(blocks, problem.mask[:, w], count) for w in wheels], axis=1)
    errors = np.sqrt(np.maximum(counts, 1) / noise.weights)
    return np.where(counts > 0, sums / errors, np.nan)


def _curves(decision: Decision, before: Array, after: Array) -> tuple[Curve, ...]:
    """Return the residual against each covariate, most significant first, on the wheels that terms concern."""
    problem = decision.equations.problem
    wheels = sorted({w for term in decision.whole.terms for w in term.wheels}) or list(decision.equations.all_wheels)
    couplings = {"offset": np.ones(problem.mask.shape), "gain": np.sign(problem.filled)}
    if problem.reverses:
        couplings["drag"] = problem.covariates["direction"]
    curves = [
        curve
        for name in problem.covariates
        if name == "direction" or has_smooth_term(problem, name)
        for curve in _curves_over(problem, name, couplings, (before, after), decision.noise, wheels)
    ]
    return tuple(sorted(curves, key=lambda curve: -float(np.mean((curve.before / curve.standard_error) ** 2))))


def _curves_over(
    problem: Problem,
    name: str,
    couplings: Mapping[str, Array],
    residuals: tuple[Array, Array],
    noise: NoiseModel,
    wheels: list[int],
) -> list[Curve]:
    """Return mean residuals in bins of a covariate, by each factor; none where there are too few readings or values."""
    values = problem.covariates[name]
    kept = problem.mask & np.isfinite(values)
    kept[:, [w for w in range(kept.shape[1]) if w not in wheels]] = False
    if kept.sum() < FEWEST_READINGS:
        return []
    edges = even_edges(values[kept], CURVE_BINS)
    if len(edges) < 3:
        return []
    acting = [residual[kept] * factor[kept] for factor in couplings.values() for residual in residuals]
    binned = binned_means(values[kept], edges, *acting)
    deviation = float(np.sqrt(np.mean(1 / noise.weights[wheels])))
    return [
        Curve(
            covariate=name,
            coupling=coupling,
            at=binned.at,
            before=before,
            after=after,
            standard_error=deviation / np.sqrt(binned.count),
            wheels=tuple(problem.recording.wheels[w] for w in wheels),
        )
        for coupling, before, after in zip(couplings, binned.means[::2], binned.means[1::2], strict=True)
    ]
