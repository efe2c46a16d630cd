"""What a candidate is: a term with unit, sign and shape, where it acts, and the drive that shows it alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.simulation.problem import Problem

Array = NDArray[np.float64]
SHAPE_TOLERANCE = 0.02
"""Share by which a coefficient and the same number in its column may differ."""
UNLIKELY_SHAPE_PENALTY = 9.2
"""What a shape costs against which the odds are a hundred to one: twice the logarithm of that."""
Shape = dict[str, float | str]
"""Values of the shape parameters (an onset, an order, a Stribeck speed): what enters nonlinearly."""
Sharing = Literal["all", "one"]


@dataclass(frozen=True)
class Coefficient:
    """A factor that is fitted: its name, unit ({unit} is the predicted channel's) and sign (0: either)."""

    name: str
    unit: str = "{unit}"
    sign: int = 1


class Candidate:
    """One effect: subclass it, say what it is, and return its columns.

    The effect is Σ coefficient × column, added to the prediction.
    """

    name: ClassVar[str]
    covariate: ClassVar[str]
    equation: ClassVar[str]
    signature: ClassVar[str]
    """What it looks like in a recording."""
    experiment: ClassVar[str]
    """The drive that excites it alone."""
    source: ClassVar[str]
    """Where form and size come from."""
    requires: ClassVar[tuple[str, ...]] = ()
    """Covariates without which it cannot be told."""
    coefficients: ClassVar[tuple[Coefficient, ...]]
    sharing: ClassVar[tuple[Sharing, ...]] = ("all", "one")
    """Which wheels may have it: all alike, or one alone."""
    channel: ClassVar[str | None] = None
    """Where the fault is, if not in the predicted channel."""
    free: ClassVar[Mapping[str, tuple[float, float]]] = {}
    """Shape parameters that are continuous, with their least and greatest value."""
    words: ClassVar[str]
    """What it is, in a sentence after 'there is'."""

    def applies(self, problem: Problem) -> bool:
        """Say whether this recording and simulation can have it at all."""
        return problem.has(*self.requires)

    def shapes(self, problem: Problem) -> Sequence[Shape]:  # noqa: ARG002  # subclasses look
        """Return the grid of shapes that is searched."""
        return [{}]

    def prior_penalty(self, problem: Problem, shape: Shape) -> float:  # noqa: ARG002
        """Return what this shape costs where it contradicts what was stated, or says no more than a plainer name."""
        return 0.0

    def self_consistent_shape(self, problem: Problem, shape: Shape, values: Sequence[float]) -> Shape:  # noqa: ARG002
        """Return the shape that agrees with its fitted coefficients, where a law is not linear in them."""
        return shape

    def onset_profiles(self, problem: Problem) -> Sequence[Shape]:
        """Return the ways to grow after an onset: every shape but for its onset."""
        found = {tuple(sorted((k, v) for k, v in s.items() if k != "onset_s")) for s in self.shapes(problem)}
        return [dict(growth) for growth in sorted(found, key=str)]

    def shape_count(self, problem: Problem) -> float:
        """Return how many different shapes were open to choice: what a choice among them must be paid for."""
        return max(len(self.shapes(problem)), 1)

    def propose_shapes(self, problem: Problem, residual: Array) -> Sequence[Shape]:  # noqa: ARG002
        """Return further shapes that a residual suggests, where a grid would be too fine to search blindly."""
        return []

    def autocorrelation_time_at(self, problem: Problem, residual: Array, shape: Shape) -> float:  # noqa: ARG002
        """Return how many readings count as one for this shape's columns; infinite where only the long run is known."""
        return float("inf")

    def own_channel_evidence(self, problem: Problem, shape: Shape) -> tuple[Array, Array] | None:  # noqa: ARG002
        """Return what the fault's own channel says, for each wheel: the gain there and the coefficient; or nothing."""
        return None

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return the columns, shape (coefficient, time, wheel), in the predicted channel's unit per coefficient."""
        raise NotImplementedError

    def bounds(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:  # noqa: ARG002
        """Return the free shape parameters' range in this recording."""
        return self.free

    def parameters(self, shape: Shape, values: Sequence[float]) -> dict[str, float]:
        """Return what the answer reports: coefficients and free shape parameters by name."""
        found = {c.name: float(v) for c, v in zip(self.coefficients, values, strict=False)}
        return {**found, **{name: float(shape[name]) for name in self.free if name in shape}}


def onset_grid(problem: Problem, count: int = 24) -> list[float]:
    """Return times at which something may begin [s]: evenly spread, not within 3 % of either end."""
    return [float(t) for t in problem.length_s * np.linspace(0.03, 0.95, count)]


def growth_since(problem: Problem, onset_s: float, rise_s: float) -> Array:
    """Return growth from 0 at the onset, shape (time, 1): a step (rise 0), an approach to 1, or a ramp (rise inf)."""
    after = np.maximum(problem.time_s - onset_s, 0.0)
    if rise_s == 0:
        return (problem.time_s >= onset_s).astype(np.float64)
    if np.isinf(rise_s):
        return after / max(problem.length_s - onset_s, 1e-9)
    return -np.expm1(-after / rise_s)
