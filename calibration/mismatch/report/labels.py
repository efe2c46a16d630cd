"""Text of the report: names of effects, covariates, wheels, units and times as people write them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.changes import direction_of
from regolithd.calibration.mismatch.empirical.stated import curve_label
from regolithd.calibration.mismatch.inference.statements import (
    after_number,
    capital,
    had_to_leave_its_prior,
    is_constant,
    listed,
    noun_before,
    noun_of,
    parameters_found,
    wheels_in_words,
)
from regolithd.calibration.mismatch.problem.words import COVARIATES, in_words, unit_in_label

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from regolithd.calibration.mismatch.answer import Answer, Change, Evidence, Unexplained
    from regolithd.calibration.mismatch.candidates.candidate import Candidate

PARAMETERS = {
    "lag_s": "lag",
    "onset_s": "onset",
    "factor": "factor on the curve",
    "relative_size": "share of the mean reading",
}
"""Parameters that the engine adds to those of a candidate."""
UNITS = {"degC": "°C", "1": ""}
"""Units whose spelling in the answer is not the usual one."""
WITH_MILLI = frozenset({"A"})
"""Units of a channel that are shown in thousandths where the mean reading is below 1."""
SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}
"""Seconds of each unit of time."""
LONGEST_IN_UNIT = {"s": 180.0, "min": 300.0}
"""Recordings and periods up to so many of a unit are told in it, longer ones in the next (a choice)."""


@dataclass(frozen=True)
class Labels:
    """Names for one report.

    Attributes
    ----------
    wheel: what a column of the recording is called: wheel, axis, side
    covariates: axis labels with units, as the simulation gives them
    candidates: by name
    time_unit: unit of times: s, min or h
    in_milli: whether values of the channel are in thousandths of its unit
    corrected: names of the effects that the simulation was corrected by
    """

    wheel: str = "wheel"
    covariates: Mapping[str, str] = field(default_factory=dict)
    candidates: Mapping[str, Candidate] = field(default_factory=lambda: {c.name: c for c in library()})
    time_unit: str = "min"
    in_milli: bool = False
    corrected: frozenset[str] = frozenset()

    @classmethod
    def of(cls, evidence: Evidence, *, alone: bool = False) -> Labels:
        """Return the labels of the evidence's simulation, of its channel `alone` or of all channels."""
        time_unit = unit_of_time(float(evidence.time_s[-1] - evidence.time_s[0]))
        candidates = {candidate.name: candidate for candidate in evidence.candidates or library()}
        in_milli = evidence.unit in WITH_MILLI and float(np.nanmean(np.abs(evidence.measured))) < 1
        channels = (evidence, *evidence.others)
        told = {name: label for each in channels for name, label in each.covariate_labels.items()}
        # What has another name in another channel, as the predicted value has, is told by its general name.
        same = {
            n: label for n, label in told.items() if all(c.covariate_labels.get(n, label) == label for c in channels)
        }
        covariates = evidence.covariate_labels if alone else same
        problems = [each.problem for each in channels]
        corrected = frozenset(effect.name for problem in problems if problem for effect in problem.stated)
        kind = noun_of(evidence.wheel_column)
        return cls(kind, covariates, candidates, time_unit, in_milli, corrected)

    @property
    def time_factor(self) -> float:
        """Factor from seconds to `time_unit`."""
        return 1 / SECONDS[self.time_unit]

    def from_to(self, from_s: float, to_s: float) -> str:
        """Return a time range: "0.0 to 6.2 min", "12 to 98 s"."""
        places = {"s": 0, "min": 1, "h": 2}[self.time_unit]
        first, last = (f"{each * self.time_factor:.{places}f}" for each in (from_s, to_s))
        return f"{first} to {last} {self.time_unit}"

    def scaled(self, unit: str) -> tuple[float, str]:
        """Return factor and unit in which a value is shown: small currents in milliampere, others as they are."""
        if self.in_milli and unit.split(" ", maxsplit=1)[0] in WITH_MILLI:
            return 1000.0, "m" + unit
        return 1.0, UNITS.get(unit, unit)

    def effect(self, name: str) -> str:
        """Return an effect's label; of a parameter's effect the name with spaces."""
        candidate = self.candidates.get(name)
        label = candidate.label if candidate else curve_label(name)
        return in_words(label, self.covariates) if label else name.replace("-", " ").replace("_", " ")

    def if_changed(self, name: str, found: Collection[str], told: str) -> str:
        """Return how an effect is told among those that could be there: as changed, where the simulation has it.

        `found` are the names of effects found beside the corrected ones.
        """
        return f"{told} (changed)" if name in self.corrected and name not in found else told

    def axis(self, covariate: str) -> str:
        """Return a covariate's axis label, with its unit where that is known."""
        if covariate == "time":
            return f"time ({self.time_unit})"
        named = COVARIATES.get(covariate, covariate.replace("_", " "))
        return self.covariates.get(covariate, named).removesuffix(" (1)")

    def covariate(self, name: str) -> str:
        """Return a covariate's name in a sentence, without its unit."""
        return self.axis(name).split(" (")[0] if name != "none" else COVARIATES[name]

    def the(self, name: str) -> str:
        """Return a covariate's name with its article, if it has one: "the belt speed", "time"."""
        return self.covariate(name) if name in {"time", "none"} else f"the {self.covariate(name)}"

    def period(self, place: Unexplained) -> str:
        """Return what is told of the period of a sine: ", with a period of 12.3 s"; nothing where there is none."""
        if place.period is None:
            return ""
        period, unit = place.period, unit_in_label(place.covariate, self.covariates)
        if place.covariate == "time":
            unit = unit_of_time(period)
            period /= SECONDS[unit]
        return f", with a period of {period:.3g}{after_number(unit)}"

    def parameter(self, effect: str, name: str) -> str:
        """Return the label of an effect's parameter."""
        candidate = self.candidates.get(effect)
        own = candidate.parameter_labels.get(name) if candidate else None
        return own or PARAMETERS.get(name) or self.effect(name)

    def wheels(self, wheels: Sequence[int | str], everything: Sequence[int | str]) -> str:
        """Return 'all 6 wheels', 'both axes', 'wheel 4' or 'wheels 1, 3'; nothing where the machine has one alone."""
        if len(wheels) == len(everything):
            return wheels_in_words(wheels, len(everything), self.wheel)
        return noun_before(wheels, self.wheel) + ", ".join(map(str, wheels))


def unit_of_time(longest_s: float) -> str:
    """Return the unit in which times up to so long [s] are told."""
    return next((unit for unit, most in LONGEST_IN_UNIT.items() if longest_s <= most * SECONDS[unit]), "h")


def verdict_sentence(answer: Answer, labels: Labels | None = None) -> str:
    """Return the verdict in one sentence."""
    labels = labels or Labels()
    if answer.verdict == "consistent":
        return "Simulation and recording agree to within the noise."
    left_out = _left_out_sentence(answer, labels)
    changed = [f"{capital(labels.effect(change.name))} is {_than_corrected(change)}." for change in answer.changes]
    found = parameters_found(answer.parameters, unexplained=answer.verdict == "unexplained")
    moved = [f"The parameter {had_to_leave_its_prior(each.told_name)}." for each in found]
    return " ".join(sentence for sentence in (left_out, *dict.fromkeys(changed), *moved) if sentence)


def _than_corrected(change: Change) -> str:
    direction = direction_of(change)
    return "gone" if direction == "gone" else f"{direction} than it was"


def _left_out_sentence(answer: Answer, labels: Labels) -> str:
    """Return what is named and what is not; empty where there is neither."""
    names = list(dict.fromkeys(labels.effect(effect.name) for effect in answer.effects))
    if answer.verdict == "missing-physics":
        return f"The simulation leaves out {listed(names)}." if names else ""
    varied = (place for place in answer.unexplained if not is_constant(place))
    covariates = list(dict.fromkeys(labels.the(place.covariate) for place in varied))
    place = f" that depends on {listed(covariates)}" if covariates else ""
    if names:
        return f"The simulation leaves out {listed(names)} – and something{place} that no known effect explains."
    return f"The simulation leaves out something{place}, and no known effect explains it."
