"""Readings of the predicted channel: which are compared, and which are faults, at a limit, or have no zero."""
