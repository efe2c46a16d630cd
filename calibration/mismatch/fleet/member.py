"""What recordings say of whose they are, and when they began."""

from __future__ import annotations

import re
from datetime import UTC, datetime

ONLY_ROVER = "rover"
"""Name of the rover where recordings do not say whose they are: they are all of one."""
_DATE = re.compile(r"(?<!\d)(20\d\d)-?([01]\d)-?([0-3]\d)(?:[T_ -]?([0-2]\d)[:-]?([0-5]\d)(?:[:-]?([0-5]\d))?)?(?!\d)")


def date_in(text: str) -> datetime | None:
    """Return the date, and the time of day where there is one, in a file's name: 2026-05-03, 20260503T081500Z."""
    for found in _DATE.finditer(text):
        year, month, day, hour, minute, second = (int(part) if part else 0 for part in found.groups())
        try:
            return datetime(year, month, day, hour, minute, second, tzinfo=UTC)
        except ValueError:
            continue
    return None
