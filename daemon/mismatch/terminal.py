"""The answer as text on the terminal."""

from __future__ import annotations

import textwrap
from math import isfinite
from typing import TYPE_CHECKING

from rich.text import Text

from regolithd.calibration.mismatch.fleet.told.answer import FleetAnswer
from regolithd.calibration.mismatch.inference.rounding import with_interval
from regolithd.calibration.mismatch.inference.statements import (
    NO_HELP,
    REFUSED,
    after_number,
    beyond_prior_in_words,
    doubt_of,
    has_curve_of,
    notes_beside_priors,
    on_wheels,
    parameters_found,
    percent,
    what_it_follows,
    without_name,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from regolithd.calibration.mismatch.answer import (
        Answer,
        Effect,
        FitImprovement,
        Indistinguishable,
        Parameter,
        Unexplained,
    )
    from regolithd.calibration.mismatch.report.labels import Labels

NO_BREAK = "\u00a0"
"""A space at which a line is not broken."""
MOST_NOT_FOUND = 2
"""Sets of effects without a finding that are told with their experiments (a choice: a terminal's page)."""
TOLD_IN_THE_STATEMENT = ("relative_size", "onset_s")
"""Parameters of an effect that its statement has in words."""


def print_answer(console: Console, answer: Answer, labels: Labels, wheels: Sequence[int | str] = ()) -> None:
    """Print verdict, effects, changes, what is unexplained or indistinguishable, errors, and what bounds the answer.

    `wheels` are all that the recording has; empty: not known. On a terminal, lines that continue are indented; a file
    or a pipe gets each on one line.
    """
    doubt = doubt_of(answer)
    console.print(Text.assemble((answer.verdict, "bold"), f", {doubt}" if doubt else ""))
    for line in _lines(answer, labels, wheels):
        text = _wrapped(line, console.width if console.is_terminal else 0)
        console.print(text, soft_wrap=True, markup=False, emoji=False)


def sure_of(answer: Answer) -> str:
    """Return how probable the answer is, and which other is next."""
    if answer.probability is None:
        why = ": what is unexplained was not decided by the evidence of a curve" if answer.unexplained else ""
        return f"probability of this answer: not known{why}"
    text = f"probability of this answer: {answer.probability:.2f}"
    if (other := answer.next_best) is None:
        return text
    names = (*other.effects, *without_name(other))
    order = "next" if other.probability <= answer.probability else REFUSED
    return f"{text}; {order}: {' + '.join(names) or 'nothing'} ({other.probability:.2f})"


def _wrapped(line: str, width: int) -> str:
    """Return a line indented, and with its continuation indented further; a width of 0 does not break it."""
    indent = "  " + " " * (len(line) - len(line.lstrip()))
    if not width:
        return f"  {line}"
    kept = line.strip().replace(" %", NO_BREAK + "%")
    return textwrap.fill(
        kept, width, initial_indent=indent, subsequent_indent=indent + "  ", break_on_hyphens=False
    ).replace(NO_BREAK, " ")


def _lines(answer: Answer, labels: Labels, wheels: Sequence[int | str]) -> list[str]:
    several = len(answer.fits) > 1
    moved = parameters_found(answer.parameters, unexplained=answer.verdict == "unexplained")
    named = {*(effect.name for effect in answer.effects), *(change.name for change in answer.changes)}
    told = [each for each in answer.indistinguishable if named.intersection(each.effects)]
    return [
        *(line for effect in answer.effects for line in _effect(effect, several=several)),
        *(f"changed{f' in {change.channel}' if several else ''}: {change.statement}" for change in answer.changes),
        *(f"parameter {beyond_prior_in_words(each)}" for each in moved),
        *_all_unexplained(answer.unexplained, labels, len(wheels), several=several),
        *(_not_distinguished(each, answer, labels) for each in told),
        sure_of(answer),
        *map(_error, answer.fits or (answer.fit,)),
        *_all_not_found([each for each in answer.indistinguishable if each not in told], answer, labels),
        *(f"note: {note}" for note in notes_beside_priors(answer.notes, moved)),
    ]


def _effect(effect: Effect, *, several: bool) -> list[str]:
    """Return the line about an effect, and those with its parameters that the line does not tell, indented."""
    line = f"{effect.name}{f' in {effect.channel}' if several else ''}: {effect.statement}"
    numbers = {name: each for name, each in effect.parameters.items() if name not in TOLD_IN_THE_STATEMENT}
    return [line, *(f"  {_value(name, each)}{_interval(each)}" for name, each in numbers.items())]


def _interval(parameter: Parameter) -> str:
    """Return a parameter's interval in brackets; nothing where it is not known."""
    _, low, high = with_interval(parameter.value, parameter.low, parameter.high)
    return f" (90 % sure: {low} to {high})" if isfinite(parameter.low) else ""


def _not_distinguished(found: Indistinguishable, answer: Answer, labels: Labels) -> str:
    """Return a set of effects, one of which was found, with its experiment."""
    told = "these recordings do not" if isinstance(answer, FleetAnswer) else "this recording does not"
    return f"{_names_of(found, answer, labels)}: {told} distinguish them. {found.experiment}"


def _all_not_found(sets: Sequence[Indistinguishable], answer: Answer, labels: Labels) -> list[str]:
    """Return the lines about the first sets without a finding, and how many more there are."""
    lines = [_not_found(each, answer, labels) for each in sets[:MOST_NOT_FOUND]]
    if more := len(sets) - len(lines):
        lines.append(f"not found: {more} more such {'set' if more == 1 else 'sets'} (--report or --json)")
    return lines


def _not_found(found: Indistinguishable, answer: Answer, labels: Labels) -> str:
    """Return a set of effects without a finding, with its experiment: a limit of the recording, as the notes are."""
    told = "these recordings" if isinstance(answer, FleetAnswer) else "this recording"
    names = _names_of(found, answer, labels)
    return f"not found: {names}. If there were one, {told} would not tell which. {found.experiment}"


def _names_of(found: Indistinguishable, answer: Answer, labels: Labels) -> str:
    """Return the names of a set, each of which may stand alone, and those that may only stand beside the first."""
    named = {effect.name for effect in answer.effects}
    names = " or ".join(labels.if_changed(name, named, name) for name in found.alone)
    names += f", or {found.alone[0]} with {' or '.join(found.beside)} beside it" if found.beside else ""
    return f"{names} in {found.channel}" if len(answer.fits) > 1 else names


def _all_unexplained(found: Sequence[Unexplained], labels: Labels, of: int, *, several: bool) -> list[str]:
    """Return the lines about all that is unexplained; a curve that several regions have is told once."""
    told: list[str] = []
    for place, rest in enumerate(found):
        lines = _unexplained(rest, labels, of, several=several)
        told += lines[:1] if has_curve_of(rest, found[:place]) else lines
    return told


def _unexplained(rest: Unexplained, labels: Labels, of: int, *, several: bool) -> list[str]:
    """Return the line about what is unexplained, and those about its curve, indented."""
    follows = what_it_follows(rest, f"{labels.the(rest.covariate)}{labels.period(rest)}")
    where = "".join(f" in {each}" for each in (rest.channel if several else "", rest.told_where) if each)
    line = (
        f"unexplained{where}: {percent(rest.share_of_residual)} of the residual "
        f"{follows}{on_wheels(rest.wheels, of, labels.wheel)}, {rest.from_s:.0f} to {rest.to_s:.0f} s"
        f"{f'; only {rest.range.statement}' if rest.range else ''}"
    )
    return [line, *(f"  {each}" for each in _curve_lines(rest, labels))]


def _curve_lines(rest: Unexplained, labels: Labels) -> list[str]:
    """Return what an empirical curve brings, and the closed forms that may describe it."""
    if rest.curve is None:
        return []
    curve = rest.curve
    reach = f"{curve.at[0]:.4g} to {curve.at[-1]:.4g}{after_number(curve.covariate_unit)}"
    before = curve.held_out_rmse_before
    error = _compared(curve.held_out_rmse_after, before)
    lines = [f"empirical curve over {labels.the(rest.covariate)}, {reach}: held-out error {error} with it"]
    lines += [] if curve.helps_held_out else [f"caution: {NO_HELP}"]
    for place, each in enumerate(rest.suggestions, 1):
        numbers = ", ".join(_value(name, one) for name, one in each.parameters.items())
        lines.append(f"suggestion {place}: {each.equation}; {numbers}; {_compared(each.held_out_rmse, before)}")
    return lines


def _compared(error: float, without: float) -> str:
    """Return how much smaller an error is than that without it."""
    change = round(100 * (1 - error / without), 1) if without > 0 else 0.0
    return f"{abs(change):.1f} % {'smaller' if change >= 0 else 'larger'}" if change else "the same"


def _value(name: str, parameter: Parameter) -> str:
    value, _, _ = with_interval(parameter.value, parameter.low, parameter.high)
    return f"{name} = {value}{after_number(parameter.unit)}"


def _error(fit: FitImprovement) -> str:
    """Return the errors of one predicted column, in its unit."""
    before, after, floor = (
        f"{each:.5g}" for each in (fit.held_out_rmse_before, fit.held_out_rmse_after, fit.noise_floor_rmse)
    )
    errors = before if before == after else f"{before} before, {after} after"
    return f"held-out error of {fit.channel}: {errors}, noise floor {floor}"
