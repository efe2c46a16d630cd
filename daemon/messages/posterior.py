"""The `posterior` message: credible intervals of the soil's cohesion, friction angle and drawbar margin."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from regolithd.daemon.messages.header import Header


class IntervalReport(BaseModel):
    """The posterior of one quantity: mean, median, and the bounds of the 50 % and 90 % credible intervals."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    mean: float
    low_90: float
    low_50: float
    median: float
    high_50: float
    high_90: float


class PosteriorMessage(Header):
    """Credible intervals of the soil under the rover, from the last seconds of all wheels that turned.

    The prior is the distribution of soils that the posterior network was trained on. Where the data say little, the
    intervals are almost as wide as the prior.
    """

    cohesion_Pa: IntervalReport
    friction_angle_rad: IntervalReport
    drawbar_margin: IntervalReport
    """Thrust minus resistance, divided by the load."""
    wheels: Annotated[int, Field(ge=1, le=6)]
    """Number of wheels in the window."""
    instants: Annotated[int, Field(ge=1)]
    """Number of half seconds in the window."""
