"""How much of a wheel's turning does not become way: i = 1 − V/(r ω_wheel)."""

from __future__ import annotations

import numpy as np

from regolithd.daemon.pipeline.snapshot import Array, Mask, SlipSource


def wheel_slip(wheel_speed_rad_s: Array, ground_speed_m_s: Array, radius_m: float, turning: Mask) -> Array:
    """Return the slip of each turning wheel, NaN elsewhere and where nobody measured the ground speed; shape (6,).

    Negative where the wheel is dragged along faster than it turns. The sign of both speeds is the same forward and
    backward, so slip is the same in both directions.
    """
    rolled = radius_m * np.where(turning, wheel_speed_rad_s, np.nan)
    return 1 - ground_speed_m_s / rolled


def choose_slip(measured: Array, constant: float, turning: Mask) -> tuple[Array, tuple[SlipSource, ...]]:
    """Return the measured slip, or the configured constant where there is none, and which it is; NaN at standstill."""
    known = ~np.isnan(measured)
    slip = np.where(known, measured, np.where(turning, constant, np.nan))
    sources = tuple(
        SlipSource.NONE if not turns else SlipSource.MEASURED if known_here else SlipSource.CONFIGURED
        for turns, known_here in zip(turning.tolist(), known.tolist(), strict=True)
    )
    return slip, sources
