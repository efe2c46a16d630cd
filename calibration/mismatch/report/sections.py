"""What each section of the report shows: numbers and drawings, ready for the template."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from regolithd.calibration.mismatch.inference.statements import (
    REFUSED,
    capital,
    doubt_of,
    has_curve_of,
    is_constant,
    listed,
    percent,
    plural,
    what_it_follows,
    without_name,
)
from regolithd.calibration.mismatch.report.axes import interval, number
from regolithd.calibration.mismatch.report.curves import curve_of
from regolithd.calibration.mismatch.report.empirical import EmpiricalSection, empirical_section
from regolithd.calibration.mismatch.report.figures import curve_figure, fit_figure, interval_figure, map_figure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.answer import (
        Answer,
        Change,
        Curve,
        Effect,
        Evidence,
        Indistinguishable,
        Unexplained,
    )
    from regolithd.calibration.mismatch.report.labels import Labels

MOST_CURVES, MOST_OTHER_CURVES = 3, 8
"""Drawings of the residual against what was found, and against the other covariates (a choice: two pages)."""
SMALL_WIDTH, SMALL_HEIGHT = 390.0, 190.0
"""Size of the small drawings, two in a row [px]."""
NO_BREAK = "\u00a0"
"""A space at which a line is not broken."""


@dataclass(frozen=True)
class Figure:
    """A drawing and what its caption says: the covariate, and the wheels (empty: the only one)."""

    svg: Markup
    covariate: str = ""
    wheels: str = ""


@dataclass(frozen=True)
class ParameterRow:
    """A row of an effect's table: texts, and a drawing of the interval."""

    label: str
    value: str
    low: str
    high: str
    unit: str
    interval: Markup


@dataclass(frozen=True)
class EffectSection:
    """One named effect."""

    label: str
    statement: str
    equation: str
    facts: tuple[str, ...]
    rows: tuple[ParameterRow, ...]


@dataclass(frozen=True)
class UnexplainedSection:
    """One structure in the residual that no candidate explains; `above`: its curve is drawn with another range."""

    title: str
    facts: tuple[str, ...]
    empirical: EmpiricalSection | None = None
    above: bool = False


@dataclass(frozen=True)
class FitSection:
    """Held-out errors as texts, and the share of the error variance above the noise floor that was removed [%]."""

    before: str
    after: str
    floor: str
    unit: str
    removed: str
    svg: Markup


@dataclass(frozen=True)
class ConfusionRow:
    """Effects that predict the same here, whether one of them was found, and the experiment that tells them apart."""

    effects: str
    found: bool
    experiment: str


@dataclass(frozen=True)
class SensitivityRow:
    """A candidate's smallest detectable effect."""

    label: str
    size: str
    share: str


@dataclass(frozen=True)
class Certainty:
    """The probability of the set of names, the next best answer with its own, and a doubt; empty: there is none."""

    given: str
    next: str = ""
    doubt: str = ""


def certainty(answer: Answer, labels: Labels) -> Certainty:
    """Return how sure the answer is of its names."""
    given = "unknown" if answer.probability is None else f"{answer.probability:.2f}"
    if (other := answer.next_best) is None:
        return Certainty(given, doubt=doubt_of(answer))
    names = [*map(labels.effect, other.effects), *without_name(other)]
    order = REFUSED if answer.probability is not None and other.probability > answer.probability else "next best"
    told = f"{order}: {listed(names or ['nothing missing'])} ({other.probability:.2f})"
    return Certainty(given, told, doubt_of(answer))


def summary(evidence: Evidence, labels: Labels) -> tuple[tuple[str, str], ...]:
    """Return what was compared, as pairs of a number and its noun."""
    length = float(evidence.time_s[-1] - evidence.time_s[0]) * labels.time_factor
    several = len(evidence.wheels) > 1
    count = [(str(len(evidence.wheels)), plural(labels.wheel))] if several else []
    values = [
        (f"{int(np.isfinite(each.before).sum()):,}", f"values of {each.channel} compared")
        for each in (evidence, *evidence.others)
    ]
    return tuple((first, second) for first, second in (*count, (number(length), labels.time_unit), *values))


def residual_map(answer: Answer, evidence: Evidence, labels: Labels) -> Markup:
    """Return the drawing of each wheel's residual over time; empty where there are no blocks."""
    return _safe(map_figure(answer, evidence, labels)) if len(evidence.map_time_s) else Markup("")


def curves(answer: Answer, evidence: Evidence, labels: Labels) -> tuple[Figure, ...]:
    """Return the residual against the covariate of everything that was found; else the curve that stands out most."""
    places = [_effect_place(found, labels) for found in answer.effects]
    places += [_change_place(change, evidence, labels) for change in answer.changes]
    places += [_unexplained_place(place, evidence) for place in answer.unexplained]
    found = (curve_of(evidence, name, wheels, along_motion=along) for name, wheels, along in dict.fromkeys(places))
    drawn = [curve for curve in found if curve is not None] or list(evidence.curves[:1])
    return tuple(_curve(curve, answer, evidence, labels) for curve in drawn[:MOST_CURVES])


def _effect_place(found: Effect, labels: Labels) -> tuple[str, tuple[int | str, ...], bool]:
    """Return the covariate, the wheels, and whether the residual is to be multiplied by the sign of the speed."""
    candidate = labels.candidates.get(found.name)
    along = (candidate is None or candidate.along_motion) and found.covariate != "direction"
    return found.covariate, found.wheels, along


def _change_place(change: Change, evidence: Evidence, labels: Labels) -> tuple[str, tuple[int | str, ...], bool]:
    """Return the same of an effect that has changed: the wheels that have it."""
    candidate = labels.candidates.get(change.name)
    covariate = candidate.covariate if candidate else "time"
    wheels = [each.wheels for each in evidence.contributions if each.name == change.name]
    along = (candidate is None or candidate.along_motion) and covariate != "direction"
    return covariate, wheels[0] if wheels else evidence.wheels, along


def _unexplained_place(place: Unexplained, evidence: Evidence) -> tuple[str, tuple[int | str, ...], bool]:
    """Return the same of a structure that no candidate explains: as its clearest curve has it."""
    couplings = (curve.coupling for curve in evidence.curves if curve.covariate == place.covariate)
    return place.covariate, place.wheels, next(couplings, "drag") == "drag"


def _curve(curve: Curve, answer: Answer, evidence: Evidence, labels: Labels) -> Figure:
    svg = _safe(curve_figure(curve, evidence.unit, labels, corrected=bool(answer.effects or answer.changes)))
    return Figure(svg, labels.covariate(curve.covariate), labels.wheels(curve.wheels, evidence.wheels))


def effect(found: Effect, evidence: Evidence, labels: Labels, *, several: bool = False) -> EffectSection:
    """Return one named effect: sentence, equation, facts and table; `several`: there are others beside it."""
    factor, unit = labels.scaled(_unit_of(found, evidence))
    before, after = factor * found.rmse_before, factor * found.rmse_after
    change = f"{100 * (after / before - 1) if before else 0.0:+.1f}".replace("-", "−")
    # It is of these wheels, and the other effects are added without this one too.
    there = f" on {labels.wheels(found.wheels, evidence.wheels)}" if len(found.wheels) < len(evidence.wheels) else ""
    beside = f"{there}{' beside the other effects' if several else ''}"
    facts = (
        labels.wheels(found.wheels, evidence.wheels),
        "constant" if found.covariate == "none" else f"depends on {labels.the(found.covariate)}",
        "" if found.onset_s is None else f"from {number(found.onset_s * labels.time_factor)} {labels.time_unit} on",
        f"held-out error{beside}: {number(before)} → {number(after)} {unit} ({change} %)",
    )
    return EffectSection(
        capital(labels.effect(found.name)),
        unbroken(capital(found.statement)),
        found.equation,
        tuple(fact for fact in facts if fact),
        parameter_rows(found, labels),
    )


def parameter_rows(found: Effect, labels: Labels) -> tuple[ParameterRow, ...]:
    """Return the rows of an effect's table, with a drawing of each interval."""
    rows = []
    for name, parameter in found.parameters.items():
        # Shares are read in percent.
        factor, unit = (100.0, "%") if name == "relative_size" else labels.scaled(parameter.unit)
        value, low, high = (factor * each for each in (parameter.value, parameter.low, parameter.high))
        if np.isfinite(value):
            drawing = _safe(interval_figure(value, low, high) if np.isfinite(low) else "")
            label = labels.parameter(found.name, name)
            rows.append(ParameterRow(label, *interval(value, low, high), unit, drawing))
    return tuple(rows)


def _unit_of(found: Effect, evidence: Evidence) -> str:
    """Return the predicted channel's unit; of another column that its name ends in."""
    if found.channel == evidence.channel:
        return evidence.unit
    return found.channel.rsplit("_", 1)[-1] if "_" in found.channel else ""


def all_unexplained(places: Sequence[Unexplained], evidence: Evidence, labels: Labels) -> list[UnexplainedSection]:
    """Return what no candidate explains; a curve that several ranges have is drawn once."""
    found = []
    for index, place in enumerate(places):
        above = has_curve_of(place, places[:index])
        section = unexplained(replace(place, curve=None) if above else place, evidence, labels)
        found.append(replace(section, above=above))
    return found


def unexplained(place: Unexplained, evidence: Evidence, labels: Labels) -> UnexplainedSection:
    """Return one structure that no candidate explains: range, wheels, time, and share of the residual's power."""
    facts = (
        f"only {place.range.statement}" if place.range else "",
        labels.wheels(place.wheels, evidence.wheels),
        labels.from_to(place.from_s, place.to_s),
        f"{percent(place.share_of_residual)} of the residual’s power",
    )
    curve = empirical_section(place, evidence, labels) if place.curve else None
    covariate = labels.the(place.covariate) + labels.period(place)
    title = capital(what_it_follows(place, covariate)) if is_constant(place) else f"Depends on {covariate}"
    return UnexplainedSection(title, tuple(unbroken(fact) for fact in facts if fact), curve)


def fit(answer: Answer, evidence: Evidence, labels: Labels) -> FitSection:
    """Return the held-out errors before and after, and the noise floor."""
    found = answer.fit
    factor, unit = labels.scaled(evidence.unit)
    before, after, floor = (
        factor * value for value in (found.held_out_rmse_before, found.held_out_rmse_after, found.noise_floor_rmse)
    )
    reducible = before**2 - floor**2
    removed = f"{min(100 * (before**2 - after**2) / reducible, 100):.0f}" if reducible > 0 else ""
    svg = _safe(fit_figure(answer, evidence.unit, labels))
    return FitSection(number(before), number(after), number(floor), unit, removed, svg)


def confusions(answer: Answer, labels: Labels) -> tuple[ConfusionRow, ...]:
    """Return what this recording cannot tell apart."""
    named = {effect.name for effect in answer.effects}
    found = named | {change.name for change in answer.changes}

    def of_set(one: Indistinguishable) -> str:
        alone = listed([labels.if_changed(name, named, labels.effect(name)) for name in one.alone])
        more = " or ".join(labels.effect(name) for name in one.beside)
        of_all = f"{alone}, or {labels.effect(one.alone[0])} with {more} beside it" if more else alone
        return capital(f"{of_all} in {one.channel}" if len(answer.fits) > 1 else of_all)

    return tuple(
        ConfusionRow(of_set(one), not found.isdisjoint(one.effects), one.experiment) for one in answer.indistinguishable
    )


def sensitivity(answer: Answer, evidence: Evidence, labels: Labels) -> tuple[SensitivityRow, ...]:
    """Return the smallest detectable effect of each candidate that was not found, where there is one."""
    problem = evidence.problem
    mean = float(np.nanmean(np.abs(evidence.measured))) if problem is None else problem.mean_size
    found = {each.name for each in answer.effects}
    rows = []
    for one in answer.sensitivity:
        if one.name not in found and np.isfinite(one.smallest_detectable):
            size = number(labels.scaled(one.unit)[0] * one.smallest_detectable, 2)
            share = f"{100 * one.smallest_detectable / mean:.1f} %" if mean > 0 else "–"
            rows.append(SensitivityRow(capital(labels.effect(one.name)), size, share))
    # An effect and a change of it on other wheels have one name.
    return tuple({row.label: row for row in rows}.values())


def undetectable(answer: Answer, labels: Labels) -> str:
    """Return the candidates that this recording cannot show, however large, or that it does not allow."""
    found = {each.name for each in answer.effects}
    names = [one.name for one in answer.sensitivity if not np.isfinite(one.smallest_detectable)]
    return ", ".join(labels.effect(name) for name in names if name not in found)


def other_curves(answer: Answer, evidence: Evidence, labels: Labels) -> tuple[Figure, ...]:
    """Return the residual against the covariates that are not shown above, small."""
    found = {each.covariate for each in answer.effects} | {each.covariate for each in answer.unexplained}
    shown = found or {curve.covariate for curve in evidence.curves[:1]}
    first = {curve.covariate: curve for curve in reversed(evidence.curves) if len(curve.at) > 2}
    others = [c for c in evidence.curves if first.get(c.covariate) is c and c.covariate not in shown]
    drawings = [
        curve_figure(
            curve,
            evidence.unit,
            labels,
            corrected=bool(answer.effects or answer.changes),
            width=SMALL_WIDTH,
            height=SMALL_HEIGHT,
        )
        for curve in others[:MOST_OTHER_CURVES]
    ]
    return tuple(Figure(_safe(drawing)) for drawing in drawings)


def unbroken(text: str) -> str:
    """Return a text whose numbers and percent signs stay on one line."""
    return text.replace(" %", NO_BREAK + "%")


def _safe(svg: str) -> Markup:
    """Mark a drawing as markup: its texts are escaped where they are drawn."""
    return Markup(svg)  # noqa: S704
