"""The search over rovers, wheels and dates, on the sums of all recordings, and what earns its name in it."""
