"""The `alarm/…` message: a condition that needs attention, its severity, and its evidence."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from regolithd.daemon.messages.header import Header, Time, WheelNumber

Probability = Annotated[float, Field(ge=0, le=1)]


class Severity(StrEnum):
    """Severity of an alarm."""

    WARNING = "warning"  # data are less accurate
    ERROR = "error"  # data are missing
    CRITICAL = "critical"  # the rover must not move


class SoilChangeEvidence(BaseModel):
    """The evidence of a soil-change alarm, as numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    onset: Time
    """Estimated time of the change."""
    direction: Literal["fall", "rise"]
    """Of the torque: `fall`, the soil is weaker."""
    wheels: tuple[WheelNumber, ...]
    """The wheels whose torque gives the largest statistic."""
    torque_ratio: float
    """Torque since the onset, divided by the torque expected for the same load and slip."""
    statistic: float
    """The largest CUSUM."""
    threshold: float
    """The CUSUM at which the alarm is raised."""
    cohesion_fell: Probability | None
    """Probability that the cohesion is lower than before; `null`: too little was measured before the onset."""
    friction_angle_fell: Probability | None
    drawbar_margin_fell: Probability | None


class AlarmMessage(Header):
    """A condition that needs attention begins (`active`) or ends. Retained: a new subscriber gets the current one."""

    name: str
    active: bool
    severity: Severity
    since: Time
    """When it became active; where `active` is false, when it ended, or when the session began."""
    text: str
    """What is wrong. After its end, the last text; empty if it was not active in this session."""
    remedy: str
    latching: bool = False
    """Whether it reports an occurrence, not a condition: its end does not mean that the cause is gone. A display keeps
    it until it is acknowledged and reset (ISA-18.2: latching alarm)."""
    evidence: SoilChangeEvidence | None = None
    """Of the alarm `soil-change`; `null` for all others."""
