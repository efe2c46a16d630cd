"""Wheel slip i = 1 − V/(r ω): the share of a wheel's rolling that does not move the rover."""

from __future__ import annotations

import numpy as np

from regolithd.daemon.pipeline.snapshot import Array, Mask, SlipSource


def wheel_slip(wheel_speed_rad_s: Array, ground_speed_m_s: Array, radius_m: float, turning: Mask) -> Array:
    """Return the slip of each turning wheel, NaN elsewhere and where no ground speed was measured; shape (6,).

    Negative where the hub moves faster than the wheel rolls. Both speeds change sign when the rover drives backward, so
    the slip is the same in both directions.
    """
    rolled = radius_m * np.where(turning, wheel_speed_rad_s, np.nan)
    return 1 - ground_speed_m_s / rolled


def choose_slip(measured: Array, constant: float, turning: Mask) -> tuple[Array, tuple[SlipSource, ...]]:
    """Return the measured slip, or `constant` where there is none, NaN at standstill; and the source for each wheel."""
    known = ~np.isnan(measured)
    slip = np.where(known, measured, np.where(turning, constant, np.nan))
    sources = tuple(
        SlipSource.NONE if not turns else SlipSource.MEASURED if known_here else SlipSource.CONFIGURED
        for turns, known_here in zip(turning.tolist(), known.tolist(), strict=True)
    )
    return slip, sources
