"""The library of effects as Markdown, and as text for the terminal."""

from __future__ import annotations

from inspect import cleandoc
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.candidates.candidate import NO_LOADS, OF_A_LOAD
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.inference.uncertainty.intervals import unit_of
from regolithd.calibration.mismatch.problem.words import in_units, in_words

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Sharing
    from regolithd.calibration.mismatch.simulation.simulation import Simulation

WHEELS: dict[Sharing, str] = {"all": "all alike", "one": "one alone"}
IN_TEXT = ("law", "depends on", "needs", "parameters")
"""Rows that the terminal shows."""
CHANNEL_UNIT = "channel's unit"


def effect_sections(candidates: Sequence[Candidate] | None = None) -> str:
    """Return a table of all effects and a section for each, as Markdown; by default of the library."""
    of = library() if candidates is None else candidates
    return "\n".join([*_overview(of), *_units(), *(line for candidate in of for line in _section(candidate))])


def effects_as_text(candidates: Sequence[Candidate], labels: Mapping[str, str], unit: str = CHANNEL_UNIT) -> str:
    """Return what a terminal shows of candidates: name, words, and the rows `IN_TEXT`.

    Parameters
    ----------
    labels: of covariates, as the machine calls them
    unit: of the predicted channel
    """
    width = max(map(len, IN_TEXT))
    blocks = []
    for candidate in candidates:
        rows = dict(_rows(candidate, labels, unit))
        lines = [f"  {name.ljust(width)}  {rows[name].replace('`', '')}" for name in IN_TEXT]
        blocks.append("\n".join([f"{candidate.name}: {in_words(candidate.words, labels)}", *lines]))
    return "\n".join(blocks)


def effects_of(simulation: Simulation | None) -> tuple[Sequence[Candidate], Mapping[str, str], str]:
    """Return the candidates of a simulation in its forms, its labels of covariates, and its channel's unit.

    Those that can be in none of its predicted columns, by their units, are left out.
    """
    if simulation is None:
        return library(), {}, CHANNEL_UNIT
    units = tuple(simulation.channels.values()) or (simulation.unit,)
    found = [each for each in simulation.candidates(library()) if any(map(each.acts_in, units))]
    if simulation.channels:
        return found, simulation.covariate_labels, CHANNEL_UNIT
    return [each.form_for(simulation) for each in found], simulation.covariate_labels, simulation.unit


def _overview(candidates: Sequence[Candidate]) -> Iterator[str]:
    yield "| effect | what it is | depends on | needs |\n|---|---|---|---|"
    for candidate in candidates:
        rows = dict(_rows(candidate, {}, CHANNEL_UNIT))
        link = f"[`{candidate.name}`](#{candidate.label.lower().replace(' ', '-')})"
        cells = (link, in_words(candidate.words, {}), rows["depends on"], rows["needs"])
        yield f"| {' | '.join(map(_cell, cells))} |"
    yield ""


def _units() -> Iterator[str]:
    yield "## Units of a load\n"
    yield (
        f"What needs *{OF_A_LOAD}* is looked for in a predicted column of any unit but these, whatever the column is "
        "called; no unit (`1`), percent and counts may be a load's too.\n"
    )
    yield "| a column that is a | is in |\n|---|---|"
    yield from (f"| {quantity} | {', '.join(f'`{unit}`' for unit in units)} |" for quantity, units in NO_LOADS.items())
    yield (
        "\nThe unit is that of `unit` or `channels` of your class, or the FMU's own; it is for the answer alone, and "
        "nothing is converted. If a column is no load and its unit is not in the list, write the unit as it is here "
        "(`m` for `metre`), or [leave the effects out](../how-to/simulation.md#effects-to-leave-out). "
        "If it is a load in one of these units (a drive's command in `Hz`), state another unit in your class (`1`).\n"
    )


def _section(candidate: Candidate) -> Iterator[str]:
    yield f"## {candidate.label[:1].upper()}{candidate.label[1:]}\n"
    yield f"`{candidate.name}`: {in_words(candidate.words, {})}.\n\n{cleandoc(type(candidate).__doc__ or '')}\n"
    yield "| | |\n|---|---|"
    yield from (f"| {name} | {_cell(text)} |" for name, text in _rows(candidate, {}, CHANNEL_UNIT))
    yield ""


def _rows(candidate: Candidate, labels: Mapping[str, str], unit: str) -> Iterator[tuple[str, str]]:
    yield "law", candidate.equation
    yield "depends on", f"`{candidate.covariate}`" if candidate.covariate != "none" else "nothing"
    yield "needs", _needs(candidate)
    yield "wheels", " or ".join(WHEELS[each] for each in candidate.sharing)
    yield "parameters", ", ".join(_parameters(candidate, labels, unit))
    if candidate.forms:
        yield "forms", "; ".join(f"`{form}`" for form in candidate.forms)
    if candidate.shape_keys:
        yield "`shape`", "; ".join(f"`{key}`: {_plain(words)}" for key, words in candidate.shape_keys.items())
    yield "in a residual", candidate.signature
    yield "experiment", in_words(candidate.experiment, labels)
    if candidate.experiment_one_way:
        yield "… one way only", in_words(candidate.experiment_one_way, labels)
    yield "source", candidate.source


def _needs(candidate: Candidate) -> str:
    """Return the covariates that are needed, and what else the machine must have."""
    needed = [f"`{name}`" for name in candidate.requires]
    return ", ".join([*needed, *filter(None, [candidate.needs])]) or "nothing more"


def _parameters(candidate: Candidate, labels: Mapping[str, str], unit: str) -> Iterator[str]:
    units = {each.name: in_units(each.unit, unit, labels) for each in candidate.coefficients}
    units |= {name: unit_of(name, labels) for name in (*candidate.free, *candidate.refined)}
    yield from (f"`{name}`" + (f" [{units[name]}]" if units[name] != "1" else "") for name in _told(candidate, units))


def _told(candidate: Candidate, names: Collection[str]) -> Collection[str]:
    """Return the parameters that the answer has: a candidate may keep one of its shape to itself (`parameters`)."""
    try:
        return candidate.parameters(
            dict.fromkeys((*candidate.free, *candidate.refined), 1.0), [1.0] * len(candidate.coefficients)
        )
    except KeyError:  # it asks for more of a shape than what is free
        return names


def _plain(words: str) -> str:
    """Return words whose underscores outside of code are no Markdown."""
    parts = words.split("`")
    return "`".join(part if place % 2 else part.replace("_", "\\_") for place, part in enumerate(parts))


def _cell(text: str) -> str:
    escaped = text.replace("|", "\\|")
    return escaped if "`" in text else escaped.replace("_", "\\_")
