"""The `odometry` message: the dead-reckoned position of the rover since the daemon's start."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from regolithd.daemon.messages.header import Header
from regolithd.daemon.pipeline.dead_reckoning import HeadingSource, SpeedSource  # noqa: TC001  # pydantic reads them


class OdometryMessage(Header):
    """Dead-reckoned position and heading since the start of the session: integrated speed and yaw rate, no fix.

    Origin and axes are those of the rover at the start: x forward, y to the left (ISO 8855). The error grows with the
    distance.
    """

    x_m: float
    y_m: float
    heading_rad: float
    """Positive to the left, not limited to ± π."""
    distance_m: Annotated[float, Field(ge=0)]
    """Length of the path."""
    speed_m_s: float
    speed_source: SpeedSource
    heading_source: HeadingSource
    gap_s: Annotated[float, Field(ge=0)]
    """Time without measurements, over which nothing was integrated."""
