"""One answer from the comparisons of several predicted channels that share the simulation's parameters."""

from __future__ import annotations

from dataclasses import replace
from math import prod
from typing import TYPE_CHECKING, TypeVar

from regolithd.calibration.mismatch.answer import Answer, OtherAnswer
from regolithd.calibration.mismatch.inference.other_answers.probability import TOLD
from regolithd.calibration.mismatch.inference.statements import (
    notes_beside_priors,
    notes_on_priors,
    parameters_found,
)
from regolithd.calibration.mismatch.signal.normal_interval import std_of_interval

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from regolithd.calibration.mismatch.answer import CalibratedParameter, Verdict

AnyAnswer = TypeVar("AnyAnswer", bound=Answer)
AnyParameter = TypeVar("AnyParameter", bound="CalibratedParameter")
WORST_FIRST: tuple[Verdict, ...] = ("unexplained", "missing-physics", "consistent")


def merged_answers(answers: Sequence[Answer], parameters: tuple[CalibratedParameter, ...]) -> Answer:
    """Return the findings of all channels, with the parameters as all of them together have them."""
    told = joined(answers)
    rest = told.verdict == "unexplained"
    notes = (*notes_on_priors(parameters, unexplained=rest), *notes_beside_priors(told.notes, parameters))
    named = bool(told.effects or told.changes or parameters_found(parameters, unexplained=rest))
    verdict: Verdict = "unexplained" if rest else "missing-physics" if named else "consistent"
    return replace(told, verdict=verdict, parameters=parameters, notes=notes)


def joined(answers: Sequence[AnyAnswer]) -> AnyAnswer:
    """Return the findings of all channels; the fit and the parameters are of the channel that gains most."""
    told = {answer.verdict for answer in answers}
    best = max(
        answers, key=lambda answer: answer.fit.held_out_rmse_before / max(answer.fit.held_out_rmse_after, 1e-300)
    )
    return replace(
        best,
        verdict=next(verdict for verdict in WORST_FIRST if verdict in told),
        effects=tuple(each for answer in answers for each in answer.effects),
        unexplained=tuple(each for answer in answers for each in answer.unexplained),
        indistinguishable=tuple(dict.fromkeys(each for answer in answers for each in answer.indistinguishable)),
        fits=tuple(answer.fit for answer in answers),
        sensitivity=tuple(each for answer in answers for each in answer.sensitivity),
        changes=tuple(each for answer in answers for each in answer.changes),
        left_out=tuple(each for answer in answers for each in answer.left_out),
        probability=joint([answer.probability for answer in answers]),
        alternatives=other_answers(answers),
        notes=notes_of(answers),
    )


def notes_of(answers: Sequence[Answer]) -> tuple[str, ...]:
    """Return the notes of all channels; one that is not of all of them begins with its channel."""
    of_all = set.intersection(*(set(answer.notes) for answer in answers))
    told = []
    for answer in answers:
        channel = answer.fit.channel
        begins = (channel, f"Readings of {channel} ")
        told += [note if note in of_all or note.startswith(begins) else f"{channel}: {note}" for note in answer.notes]
    return tuple(dict.fromkeys(told))


def other_answers(answers: Sequence[Answer]) -> tuple[OtherAnswer, ...]:
    """Return the most probable answers that differ in one channel, with the names of the others."""
    found = []
    for place, answer in enumerate(answers):
        kept = [*answers[:place], *answers[place + 1 :]]
        names = tuple(name for each in kept for name in told_names(each))
        found += [
            OtherAnswer(
                effects=tuple(sorted({*names, *other.effects})),
                unexplained=other.unexplained or any(each.unexplained for each in kept),
                probability=other.probability * (joint([each.probability for each in kept]) or 0.0),
                parameters=other.parameters,
            )
            for other in answer.alternatives
        ]
    return tuple(sorted(found, key=lambda other: -other.probability)[:TOLD])


def joint(probabilities: Sequence[float | None]) -> float | None:
    """Return the probability that all channels are right, if each has one."""
    known = [each for each in probabilities if each is not None]
    return prod(known) if len(known) == len(probabilities) else None


def told_names(answer: Answer) -> tuple[str, ...]:
    """Return the names of an answer: of new effects and of those that changed."""
    return tuple(dict.fromkeys([*(each.name for each in answer.effects), *(each.name for each in answer.changes)]))


def priors_from_others(answer: Answer, others: Sequence[Answer]) -> dict[str, tuple[float, float]]:
    """Return mean and standard deviation of the parameters that another channel knows better than this one.

    A simulation has one value of each parameter in all of its channels. Where one channel pulls a parameter out of its
    prior, what others know of the parameters decides whether they were stated wrongly or stand for missing physics.
    Empty where none is pulled; a channel that leaves something unexplained is not asked.
    """
    if not any(each.beyond_prior() for each in answer.parameters):
        return {}
    found = {}
    for parameter in answer.parameters:
        known = [
            each
            for other in others
            for each in other.parameters
            if other.verdict != "unexplained" and each.name == parameter.name and _std(each) < _std(parameter)
        ]
        if known:
            best = min(known, key=_std)
            found[parameter.name] = best.value, _std(best)
    return found


def of_all_wheels(answer: Answer, priors: Collection[str]) -> Answer:
    """Return an answer without the values of single wheels: another column need not have these."""
    return replace(answer, parameters=tuple(each for each in answer.parameters if each.name in priors))


def of_single_wheels(told: Iterable[AnyParameter], priors: Collection[str]) -> tuple[AnyParameter, ...]:
    """Return the values of single wheels among what channels tell, one after the other: each as the first has it."""
    found: dict[str, AnyParameter] = {}
    for each in told:
        if each.name not in priors:
            found.setdefault(each.told_name, each)
    return tuple(found.values())


def nothing_else_is_wrong(before: Sequence[Answer], after: Sequence[Answer]) -> bool:
    """Return whether channels leave nothing unexplained, and name nothing new, beside a parameter stated otherwise."""
    new = [set(told_names(now)) - set(told_names(answer)) for answer, now in zip(before, after, strict=True)]
    return not any(new) and all(answer.verdict != "unexplained" for answer in after)


def no_surer_than_before(before: Answer, now: Answer) -> Answer:
    """Return an answer that is found beside parameters as all channels have them, as probable as with those as stated.

    Beside a parameter that was stated wrongly, an effect that acts as it does is no other answer any more.
    """
    if before.probability is None or now.probability is None or before.probability >= now.probability:
        return now
    if before.unexplained or set(told_names(before)) != set(told_names(now)):
        return now
    return replace(now, probability=before.probability, alternatives=before.alternatives)


def _std(parameter: CalibratedParameter) -> float:
    return std_of_interval(parameter.low, parameter.high)
