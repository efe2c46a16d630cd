"""The answer, as data; `to_json` writes it exactly as the contract has it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]
Verdict = Literal["consistent", "missing-physics", "unexplained"]


@dataclass(frozen=True)
class Parameter:
    """A value and the bounds that hold it nine times in ten."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Effect:
    """Physics that the simulation leaves out."""

    name: str
    channel: str
    wheels: tuple[int, ...]
    covariate: str
    onset_s: float | None
    equation: str
    statement: str
    parameters: Mapping[str, Parameter]
    rmse_before: float
    rmse_after: float


@dataclass(frozen=True)
class Unexplained:
    """Structure that nothing in the library explains, where it lives, and how much of the residual it is."""

    channel: str
    wheels: tuple[int, ...]
    covariate: str
    from_s: float
    to_s: float
    share_of_residual: float


@dataclass(frozen=True)
class Indistinguishable:
    """Effects that this recording cannot tell apart, and the drive that would."""

    effects: tuple[str, ...]
    experiment: str


@dataclass(frozen=True)
class Sensitivity:
    """The smallest effect that this recording would have shown nine times in ten; infinite: none, however large."""

    name: str
    smallest_detectable: float
    unit: str


@dataclass(frozen=True)
class FitImprovement:
    """Errors on data that neither chose the effects nor fitted them."""

    channel: str
    held_out_rmse_before: float
    held_out_rmse_after: float
    noise_floor_rmse: float


@dataclass(frozen=True)
class Answer:
    """What `regolithd mismatch` says."""

    verdict: Verdict
    effects: tuple[Effect, ...]
    unexplained: tuple[Unexplained, ...]
    indistinguishable: tuple[Indistinguishable, ...]
    sensitivity: tuple[Sensitivity, ...]
    fit: FitImprovement
    notes: tuple[str, ...] = ()
    """Beyond the contract: what was wrong with the recording, and what could not be looked for."""
    version: int = 1

    def to_json(self) -> dict[str, Any]:
        """Return the contract's object: numbers that JSON can hold, tuples as lists."""
        plain: dict[str, Any] = _plain(asdict(self))
        order = ("version", "verdict", "effects", "unexplained", "indistinguishable", "sensitivity", "fit", "notes")
        return {name: plain[name] for name in order}


def _plain(value: object) -> Any:  # noqa: ANN401  # JSON has no narrower type
    if isinstance(value, dict):
        return {name: _plain(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value


@dataclass(frozen=True)
class Contribution:
    """One effect's term in the corrected simulation: enough to add it to any recording.

    Attributes
    ----------
    shape: the candidate's shape parameters
    coefficients: one for each of its columns
    wheels: the names of the wheels that have it
    relative_std: relative standard deviation of its size
    """

    name: str
    shape: Shape
    coefficients: tuple[float, ...]
    wheels: tuple[int, ...]
    relative_std: float = 0.0


@dataclass(frozen=True)
class Curve:
    """A residual against a covariate, before and after the effects, in bins that share the data evenly.

    Attributes
    ----------
    covariate: what it is plotted against
    coupling: "drag" for residual × sign of the speed, "gain" for residual × sign of the prediction, "offset" for the
        residual as it is
    at, before, after: bin centres and mean residuals, shape (bin,)
    standard_error: of a bin's mean, with the noise's memory counted in, shape (bin,)
    wheels: the wheels that went into it
    """

    covariate: str
    coupling: str
    at: Array
    before: Array
    after: Array
    standard_error: Array
    wheels: tuple[int, ...]


@dataclass(frozen=True)
class Evidence:
    """The arrays that a picture of the answer needs.

    Attributes
    ----------
    time_s: shape (time,); wheels: names of the columns
    measured, before, after: the channel, the calibrated simulation, and it with the effects in, shape (time, wheel);
        NaN where the simulation says nothing
    map_time_s, map_before, map_after: block means of the residual along the direction of rotation in units of their
        standard error, shape (block,), (block, wheel): what is above 3 or so is not noise
    curves: the residual against every covariate, the most telling first
    values: the simulation's parameters where the recording put them
    contributions: the terms of `--corrected`
    problem: what the candidates' columns are computed from; None draws no curve of an effect's own wheels
    candidates: those that were looked for, for their labels
    covariate_labels: axis labels with units, as the simulation gives them
    wheel_column: what the recording calls a wheel, an axis or a side
    """

    channel: str
    unit: str
    time_s: Array
    wheels: tuple[int, ...]
    measured: Array
    before: Array
    after: Array
    map_time_s: Array
    map_before: Array
    map_after: Array
    curves: tuple[Curve, ...]
    values: Mapping[str, float]
    contributions: tuple[Contribution, ...]
    problem: Problem | None = field(default=None, repr=False)
    candidates: tuple[Candidate, ...] = field(default=(), repr=False)
    covariate_labels: Mapping[str, str] = field(default_factory=dict, repr=False)
    wheel_column: str = "wheel"
