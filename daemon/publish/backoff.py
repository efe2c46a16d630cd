"""Exponential backoff with jitter: the delay before the next attempt to connect."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

LONGEST_S = 5.0
"""A broker that is back is connected to within this time. An attempt costs milliseconds of CPU and a few packets."""


@dataclass(slots=True)
class Backoff:
    """Delays between attempts [s]: `first`, doubling up to `longest`, each shortened at random by up to a half."""

    first: float = 0.5
    longest: float = LONGEST_S
    random: random.Random = field(default_factory=random.Random)
    attempts: int = 0

    def next(self) -> float:
        """Return the delay before the next attempt [s]."""
        whole = min(self.longest, self.first * 2.0 ** min(self.attempts, 30))
        self.attempts += 1
        return whole * self.random.uniform(0.5, 1.0)

    def reset(self) -> None:
        """Start again with the shortest delay: an attempt succeeded."""
        self.attempts = 0
