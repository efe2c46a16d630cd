"""How well sizes, onsets and values are known: covariances, 90 % intervals, and the smallest effect that would show."""
