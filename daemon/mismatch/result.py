"""Turns the answer of a comparison into the content of the `mismatch` message."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.daemon.messages.mismatch import ComparisonResult, EffectReport

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.calibration.mismatch.answer import Answer, Change, Effect
    from regolithd.daemon.mismatch.traverse import TraverseFiles


def comparison_result(answer: Answer, files: TraverseFiles, simulation: Path) -> ComparisonResult:
    """Return the message's content."""
    return ComparisonResult(
        verdict=answer.verdict,
        text=_text(answer),
        effects=tuple(_effect(each) for each in answer.effects),
        changes=tuple(_change(each) for each in answer.changes),
        recording=files.recording.name,
        simulation=simulation.name,
        report=str(files.report),
    )


def _text(answer: Answer) -> str:
    texts = []
    if names := dict.fromkeys(effect.name for effect in answer.effects):
        texts.append(f"The simulation leaves out: {', '.join(names)}.")
    if changed := dict.fromkeys(change.name for change in answer.changes):
        texts.append(f"Changed since the simulation was corrected: {', '.join(changed)}.")
    if answer.unexplained:
        texts.append("A part of the difference has no name.")
    return " ".join(texts) or "The simulation agrees with the traverse."


def _effect(effect: Effect) -> EffectReport:
    size = next(iter(effect.parameters.values()))  # the first parameter is the effect's size
    return EffectReport(
        name=effect.name,
        where=_where(effect.wheels),
        statement=effect.statement,
        size=size.value,
        unit=size.unit,
        low=size.low,
        high=size.high,
    )


def _change(change: Change) -> EffectReport:
    return EffectReport(
        name=change.name,
        where=_where(change.wheels),
        statement=change.statement,
        size=change.now,
        unit=change.unit,
        low=change.low,
        high=change.high,
    )


def _where(wheels: tuple[int | str, ...]) -> str:
    if len(wheels) == 6:
        return "all wheels"
    return f"wheel{'s' if len(wheels) > 1 else ''} {', '.join(map(str, wheels))}"
