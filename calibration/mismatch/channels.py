"""Several predicted channels: each is compared by itself, and all together have the simulation's parameters.

each channel alone ─▶ near each other ─▶ one that contradicts the others: again, with parameters as these have them
                                      ─▶ parameters from all ─▶ where these contradict a prior: again ─▶ one comparison
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from regolithd.calibration.mismatch.calibration.step import Step
from regolithd.calibration.mismatch.inference.parameters.contradictions import (
    contradictions,
    is_told,
    known_apart,
    told_apart,
)
from regolithd.calibration.mismatch.inference.parameters.joint_parameters import joint_posterior, known_better_by_others
from regolithd.calibration.mismatch.inference.several_channels import (
    merged_answers,
    no_surer_than_before,
    nothing_else_is_wrong,
    of_all_wheels,
    of_single_wheels,
    priors_from_others,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from regolithd.calibration.mismatch.inference.parameters.contradictions import Apart
    from regolithd.calibration.mismatch.inference.parameters.joint_parameters import JointPosterior
    from regolithd.calibration.mismatch.result import Comparison
    from regolithd.calibration.mismatch.simulation.known_together import Known, KnownTogether
    from regolithd.calibration.mismatch.simulation.simulation import Simulation

LINEARISATIONS = 3
"""Comparisons of a channel with what the others know of hardly known parameters, at most (a choice: one is usual)."""


class CompareChannel(Protocol):
    """The comparison of one channel, with these means and standard deviations of parameters instead of the stated.

    `together` are parameters that are known in combinations.
    """

    def __call__(self, channel: str, known: Known, together: KnownTogether | None = None, /) -> Comparison:
        """Return the comparison of a channel."""


def compare_channels(simulation: Simulation, channels: Sequence[str], of_channel: CompareChannel) -> Comparison:
    """Return the comparison of these channels of a simulation, each posed by itself first.

    Where one channel contradicts the others, it is compared again with the parameters as these have them. Where all
    channels together contradict a stated parameter, they are compared again with it as they have it. If that is not all
    that is wrong, a channel that pulls a parameter out of its prior is told what the others know of it.
    """
    alone, near = _near_each_other(simulation, channels, of_channel)
    if apart := _one_apart(simulation, alone, of_channel):
        return _merged(apart, simulation)
    answers = [each.answer for each in alone.values()]
    if restated := _joint(alone.values(), simulation).restated(simulation.parameters):
        again = [of_channel(channel, {**near[channel], **restated}) for channel in channels]
        if nothing_else_is_wrong(answers, [each.answer for each in again]):
            sure = [no_surer_than_before(answer, one.answer) for answer, one in zip(answers, again, strict=True)]
            again = [replace(one, answer=answer) for one, answer in zip(again, sure, strict=True)]
            return _merged(again, simulation)
    found, common = dict(alone), {name: of_all_wheels(one.answer, simulation.parameters) for name, one in alone.items()}
    for channel in alone:
        others = [common[name] for name in alone if name != channel]
        if known := priors_from_others(common[channel], others):
            found[channel] = of_channel(channel, {**near[channel], **known})
    return _merged(list(found.values()), simulation, may_release=False)


def labelled(comparison: Comparison, channel: str) -> Comparison:
    """Return a comparison whose terms say which channel they are of."""
    evidence = comparison.evidence
    terms = tuple(replace(term, channel=channel) for term in evidence.contributions)
    fits = tuple(
        replace(fit, contributions=tuple(replace(term, channel=channel) for term in fit.contributions))
        for fit in evidence.empirical
    )
    return replace(comparison, evidence=replace(evidence, contributions=terms, empirical=fits))


def _near_each_other(
    simulation: Simulation, channels: Sequence[str], of_channel: CompareChannel
) -> tuple[dict[str, Comparison], dict[str, Known]]:
    """Return each channel's comparison, and what the others know of the parameters that are hardly known.

    Channels are linearised each by itself. Of a product of two such parameters a channel knows neither, and may have
    both far from where another channel has one: there its tangents do not tell what all channels know together. It is
    told what the others know, and compared again, until the tangents of all reach as far as the values of all.
    """
    alone = {channel: of_channel(channel, {}) for channel in channels}
    near: dict[str, Known] = {channel: {} for channel in channels}
    for _ in range(LINEARISATIONS):
        together = _joint(alone.values(), simulation).values(simulation.parameters)
        far = [channel for channel, one in alone.items() if _is_bent_up_to(together, one)]
        for channel in far:
            others = [one for name, one in alone.items() if name != channel and one.answer.verdict != "unexplained"]
            own, rest = _joint([alone[channel]], simulation), _joint(others, simulation)
            near[channel] = known_better_by_others(own, rest, simulation.parameters)
        again = {channel: of_channel(channel, near[channel]) for channel in far if near[channel]}
        if not again:
            break
        alone |= again
    return alone, near


def _one_apart(simulation: Simulation, alone: Mapping[str, Comparison], of_channel: CompareChannel) -> list[Comparison]:
    """Return the comparisons with that channel's again which contradicts the others; nothing where none does.

    Of several that may be the one, and in which it shows as something that is left out, the most probable is taken.
    """
    priors, answers = simulation.parameters, {name: one.answer for name, one in alone.items()}
    informations = {
        name: one.information for name, one in alone.items() if one.information and not answers[name].unexplained
    }
    found: list[tuple[Apart, Comparison]] = []
    for apart in contradictions(priors, informations):
        together = apart.known(priors)
        again = of_channel(apart.channel, {}, together)
        if again.information and is_told(again.answer, answers[apart.channel]):
            known = known_apart(again.information, together)
            found.append((apart.told_by(known, informations[apart.channel]), replace(again, information=known)))
    if not found:
        return []
    found.sort(key=lambda each: -each[0].evidence)
    told = told_apart([(apart, again.answer) for apart, again in found], list(alone))
    first, again = found[0]
    return [replace(again, answer=told) if name == first.channel else one for name, one in alone.items()]


def _is_bent_up_to(values: Mapping[str, float], one: Comparison) -> bool:
    """Return whether the tangents of a channel's comparison do not hold up to these values."""
    problem, evidence = one.evidence.problem, one.evidence
    if problem is None:
        return False
    beside = np.nan_to_num(evidence.after - evidence.before)[problem.mask]
    return Step(problem, {**problem.values, **values}, beside).is_bent()


def _joint(comparisons: Iterable[Comparison], simulation: Simulation, *, may_release: bool = True) -> JointPosterior:
    """Return the parameters' posterior from all channels."""
    informations = [each.information for each in comparisons if each.information]
    return joint_posterior(simulation.parameters, informations, may_release=may_release)


def _merged(comparisons: Sequence[Comparison], simulation: Simulation, *, may_release: bool = True) -> Comparison:
    """Return one comparison of all channels of a simulation: every finding, and the evidence of each channel.

    `may_release`: whether the channels' parameters may leave priors that they contradict.
    """
    posterior = _joint(comparisons, simulation, may_release=may_release)
    common = posterior.parameters(simulation.parameters)
    answers = [each.answer for each in comparisons]
    told = (parameter for each in answers for parameter in each.parameters)
    answer = merged_answers(answers, (*common, *of_single_wheels(told, simulation.parameters)))
    first, *others = (each.evidence for each in comparisons)
    # As in one channel: the terms of named effects, then those of changes.
    named = [term for each in comparisons for term in each.evidence.contributions[: len(each.answer.effects)]]
    changes = [term for each in comparisons for term in each.evidence.contributions[len(each.answer.effects) :]]
    values = {parameter.name: parameter.value for parameter in answer.parameters}
    evidence = replace(first, contributions=(*named, *changes), values=values, others=tuple(others))
    return replace(comparisons[0], answer=answer, evidence=evidence, simulation=simulation, information=None)
