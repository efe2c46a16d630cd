"""Turns what the sequential test reports into the content of the `mismatch` message."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.online.report import UNNAMED
from regolithd.daemon.messages.mismatch import ComparisonResult, EffectReport

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.calibration.mismatch.online.report import Change
    from regolithd.daemon.mismatch.online.monitoring import Told


def monitoring_result(told: Told, simulation: Path) -> ComparisonResult:
    """Return the message's content; there is no report, since the recording has not ended."""
    changes = told.changes
    named = any(change.name != UNNAMED for change in changes)
    names = ", ".join(dict.fromkeys(change.name for change in changes))
    text = f"Begun while driving: {names}" if changes else "What had begun while driving has not lasted"
    return ComparisonResult(
        verdict="missing-physics" if named else "unexplained" if changes else "consistent",
        text=f"{text} (sequential test; the comparison of the whole recording decides).",
        effects=tuple(_effect(change) for change in changes),
        changes=(),
        recording=told.recording,
        simulation=simulation.name,
        report="",
    )


def _effect(change: Change) -> EffectReport:
    noun = "wheels" if len(change.wheels) > 1 else "wheel"
    return EffectReport(
        name=change.name,
        where=f"{noun} {', '.join(map(str, change.wheels))}",
        statement=change.statement,
        size=change.size,
        unit=change.unit,
        low=change.low,
        high=change.high,
    )
