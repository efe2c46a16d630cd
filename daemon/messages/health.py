"""The `health` message: counters and resources of the daemon, once a second."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

from regolithd.daemon.messages.header import Header


class SyncReport(BaseModel):
    """SYNC production: counts, and delays against the schedule."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    produced: int
    skipped: int
    failed: int
    worst_late_ms: float
    mean_late_ms: float


class AcquisitionReport(BaseModel):
    """Counts of the readings (PDOs) since the start, by what was done with them."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    snapshots: int
    accepted: int
    late: int
    duplicate: int
    unexpected: int
    missing: int
    doubtful: int


class PublishingReport(BaseModel):
    """Counts of the messages that are stored until the broker acknowledges them."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    connections: int
    """Attempts to connect in this session, with those that failed."""
    queued: int
    queued_MB: float
    acknowledged: int
    repeated: int
    dropped: int
    """Lost, because the store was full or could not be read."""
    unstored: int
    """Refused by the disk, and kept in memory only."""
    damaged: int
    """Stored records that failed their checksum; each also counts in `dropped` once a later message is acknowledged."""
    torn: int
    """Files of the store whose end could not be read."""


class RecordingReport(BaseModel):
    """The recording: current file, free space, and why it fails if it does."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    file: str | None
    free_MB: float | None
    problem: str | None


class HealthMessage(Header):
    """Counters and resources of the daemon itself, once a second."""

    uptime_s: float
    cpu_s: float
    """CPU time used since the start."""
    memory_MB: float
    bus_state: str | None
    bus: dict[str, int]
    """Counts of the bus: frames, frames dropped by the kernel, error frames, …"""
    sync: SyncReport | None
    acquisition: AcquisitionReport | None
    undecodable: dict[str, int]
    """Frames that could not be decoded, by reason; the alarm `undecodable` names the nodes when it lasts."""
    events_withheld: int
    """Events and EMCY messages that came too often and were summarised (`suppressed`)."""
    publishing: PublishingReport
    recording: RecordingReport | None
    tasks: dict[str, float]
    """Seconds since each task last reported that it runs; the watchdog is fed only while all tasks report in time."""
