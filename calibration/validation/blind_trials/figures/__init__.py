"""Figures for the documentation: a screenshot of a report, and the cost of a comparison against its size."""
