"""What the report shows of each predicted channel: the part of the answer about it, its drawings and its units."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.report import sections
from regolithd.calibration.mismatch.report.labels import Labels

if TYPE_CHECKING:
    from collections.abc import Sequence

    from markupsafe import Markup

    from regolithd.calibration.mismatch.answer import Answer, Evidence


@dataclass(frozen=True)
class ChannelPart:
    """The sections about one channel.

    Attributes
    ----------
    heading: the channel's name; empty where there is one alone
    corrected: whether effects or changes were added to the simulation
    along_motion: whether the map over time has the residual multiplied by the sign of a speed
    """

    heading: str
    along_motion: bool
    corrected: bool
    map: Markup
    curves: Sequence[sections.Figure]
    effects: Sequence[sections.EffectSection]
    unexplained: Sequence[sections.UnexplainedSection]
    fit: sections.FitSection
    sensitivity: Sequence[sections.SensitivityRow]
    undetectable: str
    other_curves: Sequence[sections.Figure]


def channel_parts(answer: Answer, evidence: Evidence) -> tuple[ChannelPart, ...]:
    """Return the parts of all channels in the simulation's order, those in which something was found first."""
    shown = (evidence, *evidence.others)
    parts = [_part(_about(answer, each.channel, shown), each, alone=len(shown) == 1) for each in shown]
    return tuple(sorted(parts, key=lambda part: not (part.corrected or part.unexplained)))


def _about(answer: Answer, channel: str, shown: Sequence[Evidence]) -> Answer:
    """Return the answer with what it says of one channel alone."""
    if len(shown) == 1:
        return answer
    predicted = {each.channel for each in shown}
    changed = {term.name for term in shown[0].contributions if term.channel == channel}
    return replace(
        answer,
        # The fault of a sensor that is not predicted stands with the first channel.
        effects=tuple(
            each
            for each in answer.effects
            if each.channel == channel or (channel == shown[0].channel and each.channel not in predicted)
        ),
        unexplained=tuple(each for each in answer.unexplained if each.channel == channel),
        changes=tuple(each for each in answer.changes if each.name in changed),
        sensitivity=tuple(each for each in answer.sensitivity if each.channel == channel),
        fit=next((fit for fit in answer.fits if fit.channel == channel), answer.fit),
    )


def _part(answer: Answer, evidence: Evidence, *, alone: bool) -> ChannelPart:
    labels = Labels.of(evidence, alone=True)
    return ChannelPart(
        heading="" if alone else evidence.channel,
        along_motion=evidence.problem is None or evidence.problem.reverses,
        corrected=bool(answer.effects or answer.changes),
        map=sections.residual_map(answer, evidence, labels),
        curves=sections.curves(answer, evidence, labels),
        effects=[
            sections.effect(effect, evidence, labels, several=len(answer.effects) > 1) for effect in answer.effects
        ],
        unexplained=sections.all_unexplained(answer.unexplained, evidence, labels),
        fit=sections.fit(answer, evidence, labels),
        sensitivity=sections.sensitivity(answer, evidence, labels),
        undetectable=sections.undetectable(answer, labels),
        other_curves=sections.other_curves(answer, evidence, labels),
    )
