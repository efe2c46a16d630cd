"""What the daemon says over MQTT: every message and every topic, in one place.

The JSON Schema, the AsyncAPI document and the table in `docs/messages/` are made from this file (`regolithd schema`).
A message is one JSON object; its first fields are the same everywhere (`Header`). Names end in their unit, angles are
in radians. `null` means "not measured" or "no estimate": a value that did not arrive is never repeated or invented.
A list of six belongs to wheels 1 to 6: odd left, even right; 1, 2 front, 3, 4 middle, 5, 6 rear.

For example, `regolith/kapvik/wheel/5`:

    {"schema_version": 2, "late": false, "session": "20130611T140312Z-5f1c", "sequence": 500,
     "time": "2013-06-11T14:07:22.018291000Z", "wheel": 5, "measured": true, "valid": true, "motor_current_A": 0.08,
     "load_N": 31.6, "slip": 0.025, "slip_source": "configured", "cohesion_Pa": 3352.0, "friction_angle_rad": 0.499, …}
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from enum import IntEnum, StrEnum
from functools import lru_cache
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from regolithd.daemon.pipeline.snapshot import SlipSource
from regolithd.drivers.master.status import NodePhase  # noqa: TC001  # pydantic reads it at run time
from regolithd.drivers.signals import NodeKind  # noqa: TC001  # likewise

SCHEMA_VERSION = 2
"""Rises when a field is removed or changes its meaning; new fields alone do not raise it."""

_PER_SECOND = 1_000_000_000

Time = Annotated[
    str,
    Field(
        pattern=r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{9}Z$",
        description="UTC, ISO 8601, nanoseconds: text, because JSON numbers above 2^53 lose digits in many readers.",
        examples=["2013-06-11T14:07:22.018291000Z"],
    ),
]
WheelNumber = Annotated[int, Field(ge=1, le=6, description="Odd left, even right; 1, 2 front, 3, 4 middle, 5, 6 rear.")]
SixNumbers = Annotated[tuple[float | None, ...], Field(min_length=6, max_length=6)]
SixIntegers = Annotated[tuple[int | None, ...], Field(min_length=6, max_length=6)]
SixFlags = Annotated[tuple[bool, ...], Field(min_length=6, max_length=6)]
SixSources = Annotated[tuple[SlipSource, ...], Field(min_length=6, max_length=6)]
SixNameLists = Annotated[tuple[tuple[str, ...], ...], Field(min_length=6, max_length=6)]
NodeNumber = Annotated[int, Field(ge=1, le=127)]


@lru_cache(maxsize=4)
def _second(seconds: int) -> str:
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%S.")


def iso_time(time_ns: int) -> str:
    """Return a time [ns since 1970, CLOCK_REALTIME] as the messages write it."""
    seconds, rest = divmod(time_ns, _PER_SECOND)
    return f"{_second(seconds)}{rest:09d}Z"


class Header(BaseModel):
    """What every message begins with."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", use_attribute_docstrings=True, json_schema_serialization_defaults_required=True
    )

    schema_version: Literal[2] = 2
    """Rises when a field is removed or changes its meaning."""
    late: bool = False
    """True: not delivered when it happened, but from the store, after the broker had been away. It may have been
    received before: `session` and `sequence` tell."""
    session: str
    """One run of the daemon; sorts by start time."""
    sequence: Annotated[int, Field(ge=0)]
    """Counts within a session and topic; on `snapshot` and `wheel` the SYNC that it belongs to."""
    time: Time


class SnapshotMessage(Header):
    """Everything about one SYNC: what the six wheels and the body measured, and what was made of it."""

    model_version: str
    """Version of the network that estimated."""
    pitch_rad: float | None
    """Positive nose up."""
    roll_rad: float | None
    """Positive right side down."""
    yaw_rate_rad_s: float | None
    """Positive to the left."""
    measured: SixFlags
    """Where current, speed and load all arrived."""
    valid: SixFlags
    """Where an estimate could be made."""
    motor_current_A: SixNumbers
    """At the motor, signed."""
    motor_speed_rad_s: SixNumbers
    """At the motor, before the gears, signed."""
    load_N: SixNumbers
    """The load cell's reading."""
    ground_speed_m_s: SixNumbers
    """Speed of the wheel's hub over ground."""
    motor_temperature_degC: SixNumbers
    bus_voltage_V: SixNumbers
    """Supply voltage at the motor controller."""
    statusword: SixIntegers
    """Object 0x6041 of the motor controller."""
    wheel_torque_Nm: SixNumbers
    """At the wheel, by Eq. 11, unsmoothed."""
    smoothed_torque_Nm: SixNumbers
    """After the filter that removes momentary current drops."""
    smoothed_load_N: SixNumbers
    slip: SixNumbers
    """i = 1 − V/(r ω)."""
    slip_source: SixSources
    """Measured, the configured constant, or none because the wheel stands still."""
    cohesion_Pa: SixNumbers
    friction_angle_rad: SixNumbers
    outside_training_range: SixNameLists
    """The network's inputs that lie outside the range it was trained on: then do not trust the estimate."""


class WheelMessage(Header):
    """One wheel at one SYNC, live: what is in `snapshot` as lists of six, as plain values."""

    model_version: str
    wheel: WheelNumber
    measured: bool
    valid: bool
    motor_current_A: float | None
    motor_speed_rad_s: float | None
    load_N: float | None
    ground_speed_m_s: float | None
    motor_temperature_degC: float | None
    bus_voltage_V: float | None
    statusword: int | None
    wheel_torque_Nm: float | None
    smoothed_torque_Nm: float | None
    smoothed_load_N: float | None
    slip: float | None
    slip_source: SlipSource
    cohesion_Pa: float | None
    friction_angle_rad: float | None
    outside_training_range: tuple[str, ...]


class IntervalReport(BaseModel):
    """One quantity's posterior: its mean, its median, and the bounds of the 50 % and 90 % intervals."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    mean: float
    low_90: float
    low_50: float
    median: float
    high_50: float
    high_90: float


class PosteriorMessage(Header):
    """How sure the rover can be of its ground: intervals from the last seconds of all wheels that turned.

    Under the prior of the soils that the posterior was trained on. Wide where the data say little.
    """

    cohesion_Pa: IntervalReport
    friction_angle_rad: IntervalReport
    drawbar_margin: IntervalReport
    """Thrust that is left over the resistance, as a share of the load."""
    wheels: Annotated[int, Field(ge=1, le=6)]
    """How many wheels it rests on."""
    instants: Annotated[int, Field(ge=1)]
    """How many half seconds it rests on."""


class Presence(StrEnum):
    """Whether the daemon is there."""

    ONLINE = "online"
    OFFLINE = "offline"


class StateMessage(Header):
    """Birth and death: `offline` with the same `session` and `sequence` as an `online` ends that connection."""

    state: Presence
    reason: Literal["connected", "stopped", "failed", "connection-lost"]
    """`connection-lost` is said by the broker, as the will; its `time` is that of the connection's birth."""
    software_version: str


class IdentityReport(BaseModel):
    """Who a node says it is: objects 0x1000 and 0x1018."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    device_type: int
    vendor: int
    product: int
    revision: int
    serial: int


class NodeMessage(Header):
    """A node of the bus, whenever something about it changes."""

    node_id: NodeNumber
    kind: NodeKind
    wheel: WheelNumber | None
    required: bool
    phase: NodePhase
    nmt_state: str | None
    """As it last said (CiA 301)."""
    drive_state: str | None
    """Motor controllers: the CiA 402 state."""
    heard: Time | None
    """When its last heartbeat came."""
    identity: IdentityReport | None
    reason: str | None
    """Why it could not be booted, as a code."""
    text: str
    """The same in words, with what to do."""
    boots: int
    emergencies: int


class EmergencyMessage(Header):
    """A node's EMCY message, decoded."""

    node_id: NodeNumber
    kind: NodeKind | None
    wheel: WheelNumber | None
    code: Annotated[str, Field(pattern="^0x[0-9A-F]{4}$")]
    """0x0000: the error of before is gone."""
    register_bits: tuple[str, ...]
    """Which kinds of error are present (object 0x1001)."""
    vendor_bytes: Annotated[str, Field(pattern="^[0-9a-f]{10}$")]
    cleared: bool
    text: str


class EventMessage(Header):
    """Something that happened on the bus, in words; what a journal would show."""

    kind: str
    """`node-booted`, `node-boot-failed`, `node-lost`, `node-returned`, `drive-state-changed`, `motion-stopped`,
    `bus-state-changed`, `soil-change`."""
    node_id: NodeNumber | None
    text: str


class Severity(StrEnum):
    """How bad it is."""

    WARNING = "warning"  # the data are worth less
    ERROR = "error"  # data are missing
    CRITICAL = "critical"  # the rover must not move


class AlarmMessage(Header):
    """Something is wrong (`active`), or is so no more. Retained: who connects sees what is wrong now."""

    name: str
    active: bool
    severity: Severity
    since: Time
    text: str
    cure: str


class SyncReport(BaseModel):
    """How the SYNC keeps its time."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    produced: int
    skipped: int
    failed: int
    worst_late_ms: float
    mean_late_ms: float


class AcquisitionReport(BaseModel):
    """What became of the readings."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    snapshots: int
    accepted: int
    late: int
    duplicate: int
    unexpected: int
    missing: int


class PublishingReport(BaseModel):
    """What became of the messages that must not be lost."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    connections: int
    queued: int
    queued_MB: float
    acknowledged: int
    repeated: int
    dropped: int
    """Lost: the store was full."""
    unstored: int
    """Refused by the disk; they waited in memory alone."""
    torn: int


class RecordingReport(BaseModel):
    """How the recording fares."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    file: str | None
    free_MB: float | None
    trouble: str | None


class HealthMessage(Header):
    """How the daemon itself fares, once a second."""

    uptime_s: float
    cpu_s: float
    """CPU time used since the start."""
    memory_MB: float
    bus_state: str | None
    bus: dict[str, int]
    """Counts of the bus: frames, kernel drops, error frames, …"""
    sync: SyncReport | None
    acquisition: AcquisitionReport | None
    publishing: PublishingReport
    recording: RecordingReport | None
    tasks: dict[str, float]
    """Seconds since each task last answered; the watchdog is fed only while all do."""


class QoS(IntEnum):
    """MQTT's quality of service."""

    AT_MOST_ONCE = 0
    AT_LEAST_ONCE = 1


@dataclass(frozen=True, slots=True)
class Channel:
    """A topic below `<prefix>/<rover>/`, with what is said there and how.

    `stored`: kept on disk until the broker has acknowledged it, then sent in order, marked `late`.
    `retain`: the broker shows the last one to whoever comes; a late one is never retained.
    """

    name: str
    address: str
    message: type[Header]
    qos: QoS
    retain: bool
    stored: bool
    when: str


CHANNELS = (
    Channel("state", "state", StateMessage, QoS.AT_LEAST_ONCE, True, False, "at each connection, and at its end"),
    Channel("snapshot", "snapshot", SnapshotMessage, QoS.AT_LEAST_ONCE, False, True, "at each SYNC, in order"),
    Channel("wheel", "wheel/{wheel}", WheelMessage, QoS.AT_MOST_ONCE, False, False, "at each SYNC, live alone"),
    Channel(
        "posterior", "posterior", PosteriorMessage, QoS.AT_LEAST_ONCE, False, True, "twice a second while wheels turn"
    ),
    Channel("node", "node/{node_id}", NodeMessage, QoS.AT_LEAST_ONCE, True, True, "when something about it changes"),
    Channel("emcy", "emcy", EmergencyMessage, QoS.AT_LEAST_ONCE, False, True, "when a node sends one"),
    Channel("event", "event", EventMessage, QoS.AT_LEAST_ONCE, False, True, "when it happens"),
    Channel("alarm", "alarm/{name}", AlarmMessage, QoS.AT_LEAST_ONCE, True, True, "when it begins and ends"),
    Channel("health", "health", HealthMessage, QoS.AT_MOST_ONCE, False, False, "once a second, live alone"),
)
"""Every topic. docs/decisions says why the qualities of service are what they are."""
