"""What is told of a fleet: its effects with rovers and dates, what single recordings show beside them, and the fit."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.answer import FitImprovement, Parameter
from regolithd.calibration.mismatch.fleet.choice.alternatives import other_choices
from regolithd.calibration.mismatch.fleet.choice.held_out import HeldOutSquares, held_out_squares
from regolithd.calibration.mismatch.fleet.choice.intervals import onset_places
from regolithd.calibration.mismatch.fleet.told.answer import (
    FleetAnswer,
    FleetEffect,
    FleetParameter,
    FleetUnexplained,
    RoverOfFleet,
    to_the_minute,
)
from regolithd.calibration.mismatch.fleet.told.curves import curve_in_common
from regolithd.calibration.mismatch.fleet.told.rivals import rivals
from regolithd.calibration.mismatch.fleet.told.sensitivity import sensitivities
from regolithd.calibration.mismatch.fleet.told.sizes import parameters_of, rms, size_with_std
from regolithd.calibration.mismatch.inference.other_answers.probability import other_answers, probability
from regolithd.calibration.mismatch.inference.statements import capital, on_wheels, size_and_cost
from regolithd.calibration.mismatch.problem.prior import parted_own_name
from regolithd.calibration.mismatch.problem.problem import LeftOut
from regolithd.calibration.mismatch.problem.words import in_words
from regolithd.calibration.mismatch.signal.normal_interval import NINETY_PERCENT_STDS
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.answer import Effect, Verdict
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetTerm
    from regolithd.calibration.mismatch.fleet.told.chosen import Beside, Chosen

Array = NDArray[np.float64]


def answer_of_fleet(chosen: Chosen, channels: int = 1) -> FleetAnswer:
    """Return the answer of one channel of so many."""
    equations, fit, simulation = chosen.equations, chosen.fit, chosen.simulation
    held_out = held_out_squares(equations, fit)
    shown, beside = chosen.shown, chosen.beside
    effects = tuple(_effect(chosen, index, beside, held_out) for index in range(len(fit.named)))
    single = tuple(_of_recording(chosen, i, effect) for i, effect in shown.effects)
    unnamed = range(len(fit.named), len(fit.terms))
    curves = tuple(curve_in_common(chosen, index, beside, held_out) for index in unnamed)
    alone = tuple(_unexplained(chosen, i, each) for i, each in shown.unexplained)
    rest = (*curves, *alone)
    parameters = _parameters(chosen, beside)
    named = effects or single or any(each.beyond_prior() for each in parameters)
    verdict: Verdict = "unexplained" if rest else "missing-physics" if named else "consistent"
    before, after = (rms(squares, equations.counts) for squares in (held_out.before, held_out.after))
    floor = _noise_floor(chosen, after)
    # What single recordings show was decided by each alone, and is no choice among the names of all.
    others = None if single or alone else other_choices(chosen.chooser, fit)
    limits = replace(THRESHOLDS, highest_probability=THRESHOLDS.highest_season_probability ** (1 / channels))
    return FleetAnswer(
        verdict=verdict,
        effects=(*effects, *single),
        unexplained=rest,
        indistinguishable=rivals(chosen.chooser, fit, simulation, chosen.labels),
        sensitivity=sensitivities(chosen.chooser, fit, simulation, in_each_alone(chosen)),
        fit=FitImprovement(simulation.channel, before, after if fit.terms else before, floor),
        parameters=parameters,
        left_out=_left_out(chosen),
        probability=None if others is None else probability(others, limits),
        alternatives=other_answers(others or (), limits),
        notes=(*_notes(chosen), *((NOT_CONFIRMED,) if fit.terms and after > (1 - LEAST_FALL) * before else ())),
        rovers=tuple(_rover(chosen, rover) for rover in range(len(chosen.names.rovers))),
    )


def _rover(chosen: Chosen, rover: int) -> RoverOfFleet:
    names, at = chosen.names, chosen.equations.recordings_of[rover]
    return RoverOfFleet(
        names.rovers[rover], tuple(names.recordings[i] for i in at), names.date(at[0]), names.date(at[-1])
    )


def _effect(chosen: Chosen, index: int, beside: Beside, held_out: HeldOutSquares) -> FleetEffect:
    equations, fit, names = chosen.equations, chosen.fit, chosen.names
    term = fit.terms[index]
    candidate, acting = term.group.candidate, equations.factors(term).any(axis=0)
    where = acting & (equations.counts > 0)
    counts = equations.counts[where]
    errors = rms(held_out.without[index][where], counts), rms(held_out.after[where], counts)
    wheels = tuple(equations.wheels[w] for w in term.units.wheels if where[:, w].any())
    since = term.course.kind in {"since", "growing"}
    first, last = onset_places(equations, fit, index) if since else (0, 0)
    parameters = _sizes(chosen, index, beside)
    rovers = tuple(names.rovers[rover] for rover in term.units.rovers)
    kind, all_wheels = chosen.simulation.wheel_column, len(equations.wheels)
    return FleetEffect(
        name=term.name,
        channel=candidate.channel or chosen.simulation.channel,
        wheels=wheels,
        covariate=candidate.covariate,
        onset_s=None,
        equation=candidate.equation,
        statement=_statement(chosen, term, on_wheels(wheels, all_wheels, kind), parameters, errors),
        parameters=parameters,
        rmse_before=errors[0],
        rmse_after=errors[1],
        form=_form_of(term),
        shape=term.group.shape,
        rovers=rovers,
        recordings=tuple(names.recordings[i] for i in np.flatnonzero(where.any(axis=1))),
        since=names.date(term.course.first) if since else None,
        since_low=names.date(first) if since else None,
        since_high=names.date(last) if since else None,
        until=names.date(term.course.first) if term.course.kind == "until" else None,
    )


def _sizes(chosen: Chosen, index: int, beside: Beside) -> dict[str, Parameter]:
    """Return coefficients, shape parameters and relative size with their intervals."""
    fit, stds, simulation = beside.fit, beside.stds, chosen.simulation
    found = parameters_of(beside.equations, fit, stds, index, simulation.unit, chosen.labels)
    size, std = size_with_std(chosen.equations, beside.equations, fit, index)
    reach = NINETY_PERCENT_STDS * std
    course = fit.terms[index].course
    grown = {"growth_power": Parameter(course.power, np.nan, np.nan, "1")} if course.kind == "growing" else {}
    return {**found, **grown, "relative_size": Parameter(size, size - reach, size + reach, "1")}


def _form_of(term: FleetTerm) -> str:
    """Return the form of a law; of what begins at a date, how it goes on after that."""
    candidate = term.group.candidate
    if not (term.group.begins and candidate.forms):
        return candidate.form_of(term.group.shape)
    return "power of time" if term.course.kind == "growing" else "step"


def _statement(
    chosen: Chosen,
    term: FleetTerm,
    wheels: str,
    parameters: Mapping[str, Parameter],
    errors: tuple[float, float],
) -> str:
    """Return one sentence: what, on which wheels of which rovers, since when, how large, and what it costs."""
    names, course = chosen.names, term.course
    rovers = [names.rovers[rover] for rover in term.units.rovers]
    whose = "all rovers" if len(rovers) == len(names.rovers) else ", ".join(rovers)
    of = "" if len(names.rovers) == 1 else f" of {whose}" if wheels else f", on {whose}"
    date = names.date(course.first)
    at = to_the_minute(date) if date else names.recordings[course.first]
    when = {
        "always": "",
        "since": f" since {at}",
        "until": f" until {at}",
        "growing": f" since {at}, growing by the time since the recording before to the power of {course.power:g}",
    }[course.kind]
    candidate, values = term.group.candidate, {name: each.value for name, each in parameters.items()}
    form = "" if term.course.kind == "growing" else _form_of(term)
    words = in_words(candidate.words_with(term.group.shape, values), chosen.labels) + (f" ({form})" if form else "")
    return f"{capital(words)}{wheels}{of}{when}: {size_and_cost(parameters['relative_size'], errors)}."


def _of_recording(chosen: Chosen, recording: int, effect: Effect) -> FleetEffect:
    """Return an effect that one recording shows beside those of the fleet: the rover's others are without it."""
    names = chosen.names
    plain = {each.name: getattr(effect, each.name) for each in fields(effect)}
    rover = names.rovers[int(chosen.equations.rover[recording])]
    told = f"{names.recordings[recording]} of {rover}: {effect.statement}"
    since, until = _dates_of_recording(chosen, recording)
    return FleetEffect(
        **{**plain, "statement": told},
        rovers=(rover,),
        recordings=(names.recordings[recording],),
        since=since,
        since_low=since,
        since_high=since,
        until=until,
    )


def _unexplained(chosen: Chosen, recording: int, rest: object) -> FleetUnexplained:
    names = chosen.names
    since, until = _dates_of_recording(chosen, recording)
    rover, name = names.rovers[int(chosen.equations.rover[recording])], names.recordings[recording]
    return FleetUnexplained(**vars(rest), rovers=(rover,), recordings=(name,), since=since, until=until)


def _dates_of_recording(chosen: Chosen, recording: int) -> tuple[str | None, str | None]:
    """Return since and until when something is there that one recording shows: its rover's others are without it."""
    of_rover = chosen.equations.recordings_of[int(chosen.equations.rover[recording])]
    place, date = of_rover.index(recording), chosen.names.date
    return date(recording) if place else None, date(of_rover[place + 1]) if recording != of_rover[-1] else None


def owners_of(chosen: Chosen) -> list[tuple[str, ...]]:
    """Return whose the told parameters are: all rovers', or each rover's; where they are each recording's, none."""
    rovers = chosen.names.rovers
    owners: dict[str, list[tuple[str, ...]]] = {
        "shared": [rovers],
        "rover": [(rover,) for rover in rovers],
        "recording": [],
    }
    return owners[chosen.equations.level]


def _parameters(chosen: Chosen, beside: Beside) -> tuple[FleetParameter, ...]:
    """Return each parameter where the recordings moved it: of the fleet, or of each rover; of recordings, none."""
    equations = chosen.equations
    found = []
    for place, rovers in enumerate(owners_of(chosen)):
        for name, prior in chosen.simulation.parameters.items():
            if not prior.told:
                continue
            value, std = prior.value, 0.0
            if name in equations.tangents:
                at = place * len(equations.tangents) + equations.tangents.index(name)
                value += float(beside.fit.coefficients[at])
                std = float(beside.stds[at])
            reach = NINETY_PERCENT_STDS * std
            found.append(
                FleetParameter(name, prior.unit, prior.value, prior.std, value, value - reach, value + reach, rovers)
            )
        common = {each.name: each.value for each in found if each.rovers == rovers}
        found += _own_values(chosen, beside, place, rovers, common)
    return tuple(found)


def _own_values(
    chosen: Chosen, beside: Beside, place: int, rovers: tuple[str, ...], common: Mapping[str, float]
) -> list[FleetParameter]:
    """Return the wheels' own values that are a finding, beside the common values of the parameters' owner."""
    equations, told = chosen.equations, []
    for at, name in enumerate(equations.tangents, place * len(equations.tangents)):
        of = parted_own_name(name, common) if at in equations.released else None
        if of is None:
            continue
        parameter, wheel = of
        prior = chosen.simulation.parameters[parameter]
        usual, std = common[parameter] + prior.own_of(wheel), prior.of_one_wheel(THRESHOLDS.own_share).std
        value, reach = usual + float(beside.fit.coefficients[at]), NINETY_PERCENT_STDS * float(beside.stds[at])
        told.append(FleetParameter(name, prior.unit, usual, std, value, value - reach, value + reach, rovers))
    return told


def _noise_floor(chosen: Chosen, held_out: float) -> float:
    """Return the root mean square of what all that was found leaves, in each recording alone.

    In all together where that is more than recordings leave that did not fit what was found: none alone may show it.
    """
    counts = chosen.equations.counts
    alone = rms(np.array([found.noise_floor for found in chosen.found]) ** 2 * counts.sum(axis=1), counts)
    return alone if alone <= held_out else rms(chosen.equations.squares(chosen.fit), counts)


def _left_out(chosen: Chosen) -> tuple[LeftOut, ...]:
    total: dict[tuple[str, str], int] = {}
    for found in chosen.found:
        for each in found.findings.left_out:
            total[each.channel, each.reason] = total.get((each.channel, each.reason), 0) + each.readings
    return tuple(LeftOut(channel, readings, reason) for (channel, reason), readings in total.items())


def _notes(chosen: Chosen) -> tuple[str, ...]:
    """Return the notes on the recordings, each once with those that it is of.

    Notes on what was decided of a recording alone are left out: the fleet's answer replaces that.
    """
    of: dict[str, list[str]] = {}
    for name, found in zip(chosen.names.recordings, chosen.found, strict=True):
        for note in found.findings.notes_on_recording:
            of.setdefault(note, []).append(name)
    count = len(chosen.names.recordings)
    told = tuple(f"{_which(names, count)}: {note}" for note, names in of.items())
    alone = in_each_alone(chosen)
    return (*told, f"{IN_EACH_ALONE}: {', '.join(alone)}.") if alone else told


NOT_CONFIRMED = (
    "Beside what was found, the error on recordings that did not fit it is no smaller: what acts in one recording of a "
    "rover, or in two, no other can confirm."
)
"""The note where the answer's own held-out error does not fall."""
LEAST_FALL = 1e-3
"""Share by which it falls, at least (a choice: what is told to a tenth of a percent)."""
IN_EACH_ALONE = "Looked for in each recording by itself, not in all together"
"""How the note begins of what a weak effect of is not found: what acts on another channel, or repeats in none."""


def in_each_alone(chosen: Chosen) -> list[str]:
    """Return the candidates that recordings allow, and that have no shape in common over them."""
    together = {group.candidate.name for group in chosen.equations.groups}
    return sorted({name for found in chosen.found for name in found.shapes} - together)


def _which(names: Sequence[str], count: int) -> str:
    if len(names) == count:
        return "All recordings"
    return ", ".join(names) if len(names) <= 3 else f"{', '.join(names[:2])} and {len(names) - 2} more"
