"""Numbers as text: a value and its interval with as many places as the interval's width supports."""

from __future__ import annotations

from math import floor, isfinite, log10

DIGITS = 2
"""Significant digits of an interval's width that are shown."""
WITHOUT_INTERVAL = 4
"""Significant digits of a value of which no interval is known."""
LEAST_PLAIN, GREATEST_PLAIN = 1e-5, 1e7
"""Magnitudes between which a number is written without an exponent."""


def with_interval(value: float, low: float, high: float) -> tuple[str, str, str]:
    """Return a value and the ends of its interval as text, all rounded to the same place."""
    size, width = max(abs(value), abs(low), abs(high)), high - low
    if not (isfinite(width) and width > 0):
        return plain(value), plain(low), plain(high)
    places = DIGITS - 1 - floor(log10(width))
    if LEAST_PLAIN <= size < GREATEST_PLAIN:
        decimals = max(places, 0)
        return _fixed(value, decimals), _fixed(low, decimals), _fixed(high, decimals)
    digits = max(places + 1 + floor(log10(size)), DIGITS)
    return plain(value, digits), plain(low, digits), plain(high, digits)


def plain(value: float, digits: int = WITHOUT_INTERVAL) -> str:
    """Return a number with so many significant digits."""
    return f"{value:.{digits}g}"


def _fixed(value: float, decimals: int) -> str:
    """Return a number with so many decimals; 0 itself has neither decimals nor a sign."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}" if value else "0"
