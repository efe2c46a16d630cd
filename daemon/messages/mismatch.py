"""The `mismatch` message: the last comparison of a traverse with the simulation."""

from __future__ import annotations

from typing import Literal

from pydantic import Base64Bytes, BaseModel, ConfigDict

from regolithd.daemon.messages.header import Header


class EffectReport(BaseModel):
    """An effect that the simulation leaves out, or a corrected one that has changed."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    name: str
    where: str
    """The wheels, as text: `all wheels`, `wheel 4`."""
    statement: str
    """The effect in a sentence."""
    size: float
    unit: str
    low: float
    """Lower bound of the 90 % interval."""
    high: float


class ComparisonResult(BaseModel):
    """The result of a comparison."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    verdict: Literal["consistent", "missing-physics", "unexplained"]
    text: str
    effects: tuple[EffectReport, ...]
    """What the simulation leaves out."""
    changes: tuple[EffectReport, ...]
    """Effects that a corrected simulation has, and that are of another size now."""
    recording: str
    """Name of the compared file."""
    simulation: str
    report: str
    """Path of the report, on the computer that compared; empty while driving, where `regolithd monitor` reports."""


class MismatchMessage(ComparisonResult, Header):
    """The result of the last comparison with the simulation: of a traverse by `regolithd compare`, or while driving."""


class ReportMessage(Header):
    """The report of the last comparison with the simulation, by `regolithd compare`: one page of HTML, compressed."""

    recording: str
    """Name of the compared file, as in `mismatch`."""
    html_gzip: Base64Bytes
    """The page: gzip, then base64. It has neither scripts nor references to other files."""
