"""Measured quality: blind trials of the mismatch tool, estimators against baselines, the paper's figures reproduced."""
