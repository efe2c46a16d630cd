"""The result of a check: subject, verdict, text, and what to do."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Verdict(StrEnum):
    """The verdict of a check."""

    GOOD = "good"
    WARNING = "warning"  # the daemon will run, with less accurate or less safe data
    WRONG = "wrong"  # the daemon will not run, or not acquire
    UNKNOWN = "not checked"


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report. `remedy` is empty where there is nothing to do."""

    subject: str
    verdict: Verdict
    text: str
    remedy: str = ""


def good(subject: str, text: str) -> Finding:
    """Return a finding without a problem."""
    return Finding(subject, Verdict.GOOD, text)


def warning(subject: str, text: str, remedy: str) -> Finding:
    """Return a finding of something that reduces accuracy or safety."""
    return Finding(subject, Verdict.WARNING, text, remedy)


def wrong(subject: str, text: str, remedy: str) -> Finding:
    """Return a finding of something that does not work."""
    return Finding(subject, Verdict.WRONG, text, remedy)


def unknown(subject: str, text: str, remedy: str = "") -> Finding:
    """Return that something could not be checked, and why."""
    return Finding(subject, Verdict.UNKNOWN, text, remedy)
