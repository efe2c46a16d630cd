"""Inputs as the simulation gets them: faults and units of columns, and the errors of noisy ones."""
