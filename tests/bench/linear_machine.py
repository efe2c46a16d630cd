"""A machine that is linear in everything, for tests of the engine's parts: two axes, 800 instants, white noise.

The simulation predicts `level`; the truth may add drag, a slope with the speed, or anything that a test adds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Candidate, Coefficient, Prior, Problem, Shape, Simulation, from_columns
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.regression.blocks import blocks_of_time, folds_of_blocks
from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix, empty_design
from regolithd.calibration.mismatch.regression.group import Group, Term
from regolithd.calibration.mismatch.regression.groups.candidate_groups import with_candidates
from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations, normal_equations
from regolithd.calibration.mismatch.regression.nuisance import with_nuisance
from regolithd.calibration.mismatch.signal.noise_models.noise import NoiseModel
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

Array = NDArray[np.float64]

INSTANTS, AXES, STEP_S, NOISE = 800, 2, 0.5, 0.2


class Constant(Candidate):
    """An offset."""

    name, covariate, equation, words, signature = "offset", "none", "ΔV = c", "an offset", "a constant"
    experiment, source = "stand still", "test"
    coefficients: ClassVar = (Coefficient("offset", "{unit}", 0),)

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002
        """Return 1."""
        return np.ones((1, *problem.mask.shape))


class Drag(Candidate):
    """A drag: the sign of the speed."""

    name, covariate, equation, words, signature = "drag", "direction", "ΔV = d sign(ω)", "a drag", "a sign"
    experiment, source = "drive both ways", "test"
    coefficients: ClassVar = (Coefficient("drag", "{unit}"),)

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002
        """Return sign(ω)."""
        return np.asarray(problem.covariates["direction"])[None]


class Power(Candidate):
    """A power of the speed, with the power free."""

    name, covariate, equation, words, signature = "power", "wheel_speed", "ΔV = k |ω|^p", "a power", "a curve"
    experiment, source = "drive fast and slowly", "test"
    coefficients: ClassVar = (Coefficient("factor", "{unit}"),)
    free: ClassVar = {"power": (0.5, 3.0)}

    def shapes(self, problem: Problem) -> Sequence[Shape]:  # noqa: ARG002
        """Two powers."""
        return [{"power": 1.0}, {"power": 2.0}]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return |ω|^p."""
        return np.abs(problem.covariates["wheel_speed"])[None] ** float(shape["power"])


class Step(Candidate):
    """An offset from a time on."""

    name, covariate, equation, words, signature = "step", "time", "ΔV = s (t > t_0)", "a step", "a step"
    experiment, source = "wait", "test"
    coefficients: ClassVar = (Coefficient("step", "{unit}", 0),)
    free: ClassVar = {"onset_s": (0.0, np.inf)}

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Every tenth of the recording."""
        return [{"onset_s": float(t)} for t in np.linspace(0.1, 0.9, 9) * problem.length_s]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return 1 after the onset."""
        return np.broadcast_to(problem.time_s >= float(shape["onset_s"]), problem.mask.shape)[None].astype(np.float64)

    def bounds(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:  # noqa: ARG002
        """Anywhere within the recording."""
        return {"onset_s": (0.0, problem.length_s)}


CANDIDATES = (Constant(), Drag(), Power(), Step())


class Level(Simulation):
    """A reading that should be `level`."""

    channel, unit, wheel_column = "reading_V", "V", "axis"
    inputs = ("speed_rad_s",)
    parameters: Mapping[str, Prior] = {"level": Prior(2.0, 0.5, "V")}
    parameter_effects: ClassVar = {"level": "level-error"}
    zero_means_nothing: ClassVar[bool | None] = False

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the level."""
        return values["level"] + 0 * inputs["speed_rad_s"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed."""
        return {"wheel_speed": inputs["speed_rad_s"], "time": inputs["t_s"]}

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:  # noqa: ARG002
        """Return the four of this file."""
        return CANDIDATES


def table(
    *,
    drag: float | Array = 0.0,
    factor: float = 0.0,
    power: float = 1.0,
    seed: int = 0,
    noise: float = NOISE,
    runs: int = 1,
) -> dict[str, Array]:
    """Return a recording's columns, with a drag, shape () or (time, axis), and a power of the speed added."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(INSTANTS) * STEP_S
    speed = np.sin(t_s[:, None] / 11 + np.array([0.0, 1.3])) * (1.2 + np.sin(t_s[:, None] / 31))
    reading = 2.0 + drag * np.sign(speed) + factor * np.abs(speed) ** power + noise * rng.normal(size=speed.shape)
    return {
        "t_s": np.repeat(t_s, AXES),
        "axis": np.tile([1.0, 2.0], INSTANTS),
        "run": np.repeat(np.arange(INSTANTS) * runs // INSTANTS, AXES).astype(np.float64),
        "speed_rad_s": speed.ravel(),
        "reading_V": reading.ravel(),
    }


def problem_of(columns: Mapping[str, Array], thresholds: Thresholds = THRESHOLDS) -> Problem:
    """Return the problem that a table poses."""
    return build_problem(from_columns(columns, unit="axis"), Level(), thresholds=thresholds)


def design_of(problem: Problem) -> DesignMatrix:
    """Return the design matrix without columns."""
    noise = NoiseModel(np.full(problem.mask.shape[1], NOISE), 1.0)
    return empty_design(problem, folds_of_blocks(problem, blocks_of_time(problem, noise)))


def equations_of(problem: Problem, candidates: Sequence[Candidate] = CANDIDATES) -> NormalEquations:
    """Return normal equations of the level and the candidates' grids, weighted by the true noise."""
    design, nuisance = with_nuisance(design_of(problem))
    design, _ = with_candidates(design, candidates)
    return normal_equations(design, nuisance, np.full(problem.mask.shape[1], NOISE**-2))


def group_of(equations: NormalEquations, name: str, place: int = 0) -> Group:
    """Return a candidate's group."""
    return [group for group in equations.design.groups if group.name == name][place]


def term_of(equations: NormalEquations, name: str, wheels: tuple[int, ...] = (0, 1), place: int = 0) -> Term:
    """Return a candidate's group on some wheels."""
    return Term(group_of(equations, name, place), wheels)
