"""The equations of a problem: every column of the regression, with the weights of the residual's noise.

problem ─▶ noise ─▶ blocks and folds ─▶ columns: free parameters, candidates, smooth terms ─▶ normal equations
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.regression.blocks import blocks_of_time, folds_of_blocks
from regolithd.calibration.mismatch.regression.design_matrix import empty_design
from regolithd.calibration.mismatch.regression.groups.candidate_groups import with_candidates
from regolithd.calibration.mismatch.regression.groups.lagged_groups import with_lagged_terms
from regolithd.calibration.mismatch.regression.groups.smooth_groups import with_smooth_terms
from regolithd.calibration.mismatch.regression.groups.state_groups import with_state_terms
from regolithd.calibration.mismatch.regression.likelihood.reliability import reliability_of
from regolithd.calibration.mismatch.regression.normal_equations import normal_equations
from regolithd.calibration.mismatch.regression.nuisance import with_nuisance
from regolithd.calibration.mismatch.regression.residuals import residual_of
from regolithd.calibration.mismatch.signal.noise_models.noise import NoiseModel
from regolithd.calibration.mismatch.signal.noise_models.whitening import NOT_WHITENED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations
    from regolithd.calibration.mismatch.regression.nuisance import Nuisance


def smooth_equations(problem: Problem) -> NormalEquations:
    """Return the normal equations of the simulation's free parameters and of smooth terms.

    The weights are those of the whole residual; the decision estimates better ones.
    """
    design, nuisance, noise = _free_parameters(problem)
    return normal_equations(with_lagged_terms(with_smooth_terms(design)), nuisance, noise.weights)


def with_library(
    equations: NormalEquations, candidates: Sequence[Candidate]
) -> tuple[NormalEquations, tuple[Candidate, ...]]:
    """Return the equations with every candidate that this recording allows, and those candidates.

    And with smooth terms that act on a state: they are searched for, and do not decide where it is linearised.
    """
    design, applicable = with_candidates(with_state_terms(equations.design), candidates)
    return equations.over(design), applicable


def free_parameter_equations(problem: Problem) -> NormalEquations:
    """Return the normal equations of the simulation's free parameters alone."""
    design, nuisance, noise = _free_parameters(problem)
    return normal_equations(design, nuisance, noise.weights)


def _free_parameters(problem: Problem) -> tuple[DesignMatrix, Nuisance, NoiseModel]:
    """Return a design matrix with the free parameters' columns, where they are in it, and the noise that they leave.

    A parameter that is far off makes the residual large and slow, and that noise would hold the parameter at its prior.
    So the noise is that of what the parameters leave when they are fitted under a short autocorrelation time.
    """
    limits = problem.thresholds
    noise = problem.noise_of(problem.residual)
    folds = folds_of_blocks(problem, blocks_of_time(problem, noise))
    empty = empty_design(problem, folds)
    if (reliability := reliability_of(empty, problem.residual)) is not None:
        empty = empty.whitened_by(NOT_WHITENED, reliability)
        noise = problem.noise_of(empty.whitened_in_time(problem.residual))
    design, nuisance = with_nuisance(empty)
    short = min(noise.autocorrelation_time, limits.provisional_autocorrelation_time)
    provisional = normal_equations(design, nuisance, NoiseModel(noise.deviation, short).weights)
    left = residual_of(provisional, provisional.fit(()))
    return design, nuisance, problem.noise_of(design.whitened_in_time(left))
