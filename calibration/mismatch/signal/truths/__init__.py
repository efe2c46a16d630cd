"""The truth of a noisy column, and how far an estimate is from it."""
