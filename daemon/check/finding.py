"""What a check found: where, how bad, and how to mend it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Verdict(StrEnum):
    """How it is."""

    GOOD = "good"
    WARNING = "warning"  # it will run, but something is worth less
    WRONG = "wrong"  # it will not run, or not do what it is for
    UNKNOWN = "not checked"


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report. `cure` is empty where there is nothing to mend."""

    subject: str
    verdict: Verdict
    text: str
    cure: str = ""


def good(subject: str, text: str) -> Finding:
    """Return that all is well."""
    return Finding(subject, Verdict.GOOD, text)


def warning(subject: str, text: str, cure: str) -> Finding:
    """Return that something is worth less than it could be."""
    return Finding(subject, Verdict.WARNING, text, cure)


def wrong(subject: str, text: str, cure: str) -> Finding:
    """Return that something does not work."""
    return Finding(subject, Verdict.WRONG, text, cure)


def unknown(subject: str, text: str, cure: str = "") -> Finding:
    """Return that it could not be checked, and why."""
    return Finding(subject, Verdict.UNKNOWN, text, cure)
