"""The answer of a comparison as frozen data (`Answer.to_json` gives the JSON object), and the evidence to draw it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, fields
from importlib import resources
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.normal_interval import std_of_interval
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.candidates.candidate import Candidate
    from regolithd.calibration.mismatch.contribution import Contribution
    from regolithd.calibration.mismatch.problem.corrections.empirical_curve import EmpiricalCurve, StatedCurve
    from regolithd.calibration.mismatch.problem.corrections.size_posterior import SizePosterior
    from regolithd.calibration.mismatch.problem.problem import LeftOut, Problem

Array = NDArray[np.float64]
Verdict = Literal["consistent", "missing-physics", "unexplained"]


@dataclass(frozen=True)
class Parameter:
    """A value with its 90 % interval."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Effect:
    """An effect that the simulation leaves out.

    Attributes
    ----------
    channel: the faulty channel
    wheels: their names in the recording
    onset_s: when it begins, None where it was there from the start
    rmse_before, rmse_after: held-out root mean squares on its wheels, without and with the effect
    form: which of the law's forms was found, by its name; empty where it has only one
    shape: the law's shape parameters, as `[[effects]]` of a corrected simulation has them
    law_std: relative standard deviation of what the law says of another recording, for a corrected simulation; not in
        the JSON object
    posterior: of its size together with the simulation's parameters, for the same; neither
    """

    name: str
    channel: str
    wheels: tuple[int | str, ...]
    covariate: str
    onset_s: float | None
    equation: str
    statement: str
    parameters: Mapping[str, Parameter]
    rmse_before: float
    rmse_after: float
    form: str = ""
    shape: Mapping[str, float | str] = field(default_factory=dict)
    law_std: float = field(default=0.0, metadata={"told": False})
    posterior: SizePosterior | None = field(default=None, metadata={"told": False})


@dataclass(frozen=True)
class Range:
    """The values of a covariate between which something acts, and outside of which it does not.

    Attributes
    ----------
    lower, upper: the bounds, each with its 90 % interval; None where there is none on that side
    statement: the range in words
    """

    covariate: str
    lower: Parameter | None
    upper: Parameter | None
    statement: str


@dataclass(frozen=True)
class Suggestion:
    """A closed form that may describe an empirical curve: a hypothesis, no finding.

    Attributes
    ----------
    form: its family in the grammar
    parameters: by the names in `equation`
    held_out_rmse: of the channel with this form in the place of the curve
    bic_behind: Bayesian information criterion less that of the first suggestion
    """

    form: str
    equation: str
    parameters: Mapping[str, Parameter]
    held_out_rmse: float
    bic_behind: float


@dataclass(frozen=True)
class Unexplained:
    """A structure in the residual that no candidate explains: its covariate, wheels, time and share of the power.

    `range` is where it is confined to a range of the covariate; None: it varies over the whole of it.
    `period` is that of a sine over the covariate, in its unit (seconds for time); None: it is not periodic.
    `curve` is what it looks like over its covariate; None where it is periodic in time, follows what was before, or
    acts on a state.
    `suggestions` are closed forms that may describe the curve, best first.
    """

    channel: str
    wheels: tuple[int | str, ...]
    covariate: str
    from_s: float
    to_s: float
    share_of_residual: float
    range: Range | None = None
    curve: EmpiricalCurve | None = None
    suggestions: tuple[Suggestion, ...] = ()
    period: float | None = None

    @property
    def told_where(self) -> str:
        """Whose it is, in words: nothing for the only recording."""
        return ""


@dataclass(frozen=True)
class Indistinguishable:
    """Effects that this recording cannot tell apart, and the experiment that tells them apart.

    Attributes
    ----------
    effects: names of the effects, and of parameters of the simulation, in the predicted column `channel`
    beside: those of them that would act beside the first, not in its place
    experiment: what to do, as text
    vary: the same for a program: the covariates to vary, each apart from the others
    duration_s, lift: for how long in all, and whether a part of it is without load
    """

    effects: tuple[str, ...]
    experiment: str
    vary: tuple[str, ...] = ()
    duration_s: float = 0.0
    lift: bool = False
    beside: tuple[str, ...] = ()
    channel: str = ""

    @property
    def alone(self) -> tuple[str, ...]:
        """Names of those of which each explains the recording without the others."""
        return tuple(name for name in self.effects if name not in self.beside)


@dataclass(frozen=True)
class Sensitivity:
    """The smallest effect that the recording shows with a probability of 90 %; infinite where it shows none."""

    name: str
    channel: str
    smallest_detectable: float
    unit: str


@dataclass(frozen=True)
class FitImprovement:
    """Root-mean-square errors on blocks of time that were used neither to select the effects nor to fit them."""

    channel: str
    held_out_rmse_before: float
    held_out_rmse_after: float
    noise_floor_rmse: float


NEARLY_ALL = 0.999
"""Share of a prior's variance from which on the readings say nothing of a parameter."""


@dataclass(frozen=True)
class CalibratedParameter:
    """A parameter of the simulation: its prior, and where the recording moved it, with a 90 % interval."""

    name: str
    unit: str
    prior: float
    prior_std: float
    value: float
    low: float
    high: float

    @property
    def told_name(self) -> str:
        """What it is called in a sentence."""
        return self.name

    @property
    def prior_stds_away(self) -> float:
        """How far it is from its prior, in the prior's standard deviations; 0 where the prior is exact."""
        return abs(self.value - self.prior) / self.prior_std if self.prior_std > 0 else 0.0

    @property
    def variance_left(self) -> float:
        """Its variance over that of its prior, from the 90 % interval; at most nearly 1."""
        if self.prior_std <= 0:
            return 0.0
        return min((std_of_interval(self.low, self.high) / self.prior_std) ** 2, NEARLY_ALL)

    def beyond_prior(self, thresholds: Thresholds = THRESHOLDS) -> bool:
        """Return whether it had to leave its prior: a finding, whatever else was found."""
        return self.prior_stds_away > thresholds.furthest_prior_stds


@dataclass(frozen=True)
class Change:
    """What differs from an effect that a corrected simulation brought, with a 90 % interval of what it is now.

    Attributes
    ----------
    parameter, unit: the coefficient that `corrected` and `now` are values of
    channel, wheels: where it changed
    statement: the change in one sentence
    """

    name: str
    parameter: str
    corrected: float
    now: float
    low: float
    high: float
    unit: str = "1"
    channel: str = ""
    wheels: tuple[int | str, ...] = ()
    statement: str = ""


LEAST_TOLD = 0.005
"""Probability below which another answer is not told in words: two decimals would show 0."""
JSON_KEYS = (
    *("version", "verdict", "effects", "unexplained", "indistinguishable", "sensitivity", "fit", "fits", "parameters"),
    *("changes", "left_out", "probability", "alternatives", "notes"),
)
"""Keys of the answer's JSON object, in their order."""


@dataclass(frozen=True)
class OtherAnswer:
    """An answer that was not given: names, whether something stays unexplained, parameters stated wrongly."""

    effects: tuple[str, ...]
    unexplained: bool
    probability: float
    parameters: tuple[str, ...] = ()


@dataclass(frozen=True)
class Answer:
    """The result of `regolithd mismatch`."""

    verdict: Verdict
    effects: tuple[Effect, ...]
    unexplained: tuple[Unexplained, ...]
    indistinguishable: tuple[Indistinguishable, ...]
    sensitivity: tuple[Sensitivity, ...]
    fit: FitImprovement
    parameters: tuple[CalibratedParameter, ...] = ()
    changes: tuple[Change, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    probability: float | None = None
    """That the set of names is right: of answers with 0.9 or more, nine in ten are (`make reliability`). None: unknown,
    as of many recordings together."""
    alternatives: tuple[OtherAnswer, ...] = ()
    """The most probable other answers, best first."""
    notes: tuple[str, ...] = ()
    """What was wrong with the recording, and which candidates could not be looked for."""
    fits: tuple[FitImprovement, ...] = ()
    """Of several channels: the fit of each; `fit` is that of the channel that gains most."""
    version: int = 2

    @property
    def next_best(self) -> OtherAnswer | None:
        """The most probable other answer, if two decimals show its probability."""
        return next((other for other in self.alternatives[:1] if other.probability >= LEAST_TOLD), None)

    def to_json(self) -> dict[str, Any]:
        """Return the JSON object of answer.schema.json: tuples as lists, and null for numbers that are not finite."""
        plain: dict[str, Any] = _plain(asdict(self))
        plain["fits"] = plain["fits"] or [plain["fit"]]
        untold = [each.name for each in fields(Effect) if not each.metadata.get("told", True)]
        plain["effects"] = [{k: v for k, v in each.items() if k not in untold} for each in plain["effects"]]
        return {name: plain[name] for name in JSON_KEYS}


def answer_schema() -> dict[str, Any]:
    """Return the JSON Schema of the answer (draft 2020-12)."""
    text = resources.files("regolithd.calibration.mismatch").joinpath("answer.schema.json").read_text("utf-8")
    schema: dict[str, Any] = json.loads(text)
    return schema


def _plain(value: object) -> Any:  # noqa: ANN401  # JSON has no narrower type
    if isinstance(value, dict):
        return {name: _plain(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value


@dataclass(frozen=True, eq=False)
class EmpiricalFit:
    """A curve that stands for what stays unexplained, and all that was fitted beside it.

    Attributes
    ----------
    values, contributions: the simulation's parameters and the effects' terms in that fit
    at, mean, standard_error: what all but the curve leaves, over the curve's factor, in bins of the covariate
    suggested: the first suggestion at the curve's knots; empty where there is none
    """

    curve: StatedCurve
    values: Mapping[str, float]
    contributions: tuple[Contribution, ...]
    at: Array
    mean: Array
    standard_error: Array
    suggested: Array


@dataclass(frozen=True)
class Curve:
    """A residual against a covariate, before and after the effects, in bins with equal numbers of values.

    Attributes
    ----------
    covariate: what it is plotted against
    coupling: "drag" for residual × sign of the speed, "gain" for residual × sign of the prediction, "offset" for the
        residual as it is
    at, before, after: bin centres and mean residuals, shape (bin,)
    standard_error: of a bin's mean, autocorrelation of the noise included, shape (bin,)
    wheels: the wheels that went into it
    """

    covariate: str
    coupling: str
    at: Array
    before: Array
    after: Array
    standard_error: Array
    wheels: tuple[int | str, ...]


@dataclass(frozen=True)
class Evidence:
    """The arrays that the report draws.

    Attributes
    ----------
    time_s: shape (time,); wheels: names of the columns
    measured, before, after: the channel, the calibrated simulation, and it with the effects added, shape (time, wheel);
        NaN where there is no prediction
    map_time_s, map_before, map_after: centres of blocks of time, and block means of residual × sign of the speed in
        units of their standard error, shape (block,), (block, wheel)
    curves: the residual against every covariate, the one with the largest dependence first
    values: the simulation's parameters as calibrated by the recording
    contributions: the terms of `--corrected`
    problem: what the candidates' columns are computed from; None draws no curve of an effect's own wheels
    candidates: those that were looked for, for their labels
    covariate_labels: axis labels with units, as the simulation gives them
    wheel_column: what the recording calls a wheel, an axis or a side
    others: of several channels, the evidence of the others
    empirical: the empirical curves, each with the parameters and terms of the fit beside it
    """

    channel: str
    unit: str
    time_s: Array
    wheels: tuple[int | str, ...]
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
    others: tuple[Evidence, ...] = field(default=(), repr=False)
    empirical: tuple[EmpiricalFit, ...] = field(default=(), repr=False)
