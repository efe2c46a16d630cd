"""Estimates with arbitrary values, to publish."""

import numpy as np

from regolithd.daemon.pipeline.snapshot import Estimate, SlipSource, Snapshot


def estimate(sequence: int = 500, missing_wheel: int | None = None) -> Estimate:
    """Return an estimate whose numbers have no short decimal form; optionally one wheel is not measured."""
    random = np.random.default_rng(sequence)
    values = random.normal(1.0, 0.3, (10, 6))
    values[9] = 0x1237
    derived = random.normal(1.0, 0.3, (6, 6))
    valid = np.ones(6, bool)
    outside = np.zeros((3, 6), bool)
    outside[1, 4] = True
    if missing_wheel is not None:
        values[:, missing_wheel] = derived[:, missing_wheel] = np.nan
        valid[missing_wheel] = False
    return Estimate(
        Snapshot(sequence, 1_370_959_642_018_291_000, values),
        *derived[:4],
        (SlipSource.CONFIGURED,) * 6,
        *derived[4:],
        valid,
        ("load_N", "slip", "motor_current_A"),
        outside,
        "terrain-1",
    )
