"""Recordings as arrays: read, checked, resampled."""
