"""The protocol of the control socket: one JSON object a line, in UTF-8, over a UNIX stream socket.

A client sends a request; the daemon replies with one line, or, during a traverse, with many:

    → {"command": "traverse", "distance_m": 10.0, "speed_m_s": 0.022}
    ← {"event": "accepted", "duration_s": 454.5454545454545, "wheel_speed_rad_s": 0.29333333333333333}
    ← {"event": "progress", "elapsed_s": 0.5, "turned_m": 0.011}
      …
    ← {"event": "ended", "ending": "finished", "elapsed_s": 454.5454545454545, "turned_m": 10.0, "text": "…"}

    → {"command": "stop", "quick": false}
    ← {"event": "done", "text": "…"}

    → {"command": "status"}
    ← {"event": "status", "rover": "kapvik", "nodes": [{"node_id": 1, "phase": "operational", …}, …], …}

    → {"command": "publish-comparison", "result": {"verdict": "consistent", "text": "…", …}}
    ← {"event": "done", "text": "…"}

    → {"command": "dance"}
    ← {"event": "refused", "code": "bad-request", "text": "…", "remedy": "…"}

A client that commanded a traverse keeps its connection open: when the connection closes, for any reason, the wheels are
quick-stopped. It may send `stop` in the meantime. Any other client may stop the traverse too; there is one at a time.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from regolithd.daemon.control.traverse import Ending  # noqa: TC001  # pydantic reads it at run time
from regolithd.daemon.messages.mismatch import ComparisonResult  # noqa: TC001  # likewise

LINE_LIMIT = 65_536
CONNECTED = "connected"
"""`Status.broker` while the daemon is connected to the broker."""


class _Line(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def line(self) -> bytes:
        """Return the line as it is sent."""
        return self.model_dump_json().encode() + b"\n"


class TraverseRequest(_Line):
    """Drive a distance at constant wheel speed."""

    command: Literal["traverse"] = "traverse"
    distance_m: float
    speed_m_s: float


class StopRequest(_Line):
    """Stop the traverse: with the drives' ramp, or by a quick stop."""

    command: Literal["stop"] = "stop"
    quick: bool = False


class StatusRequest(_Line):
    """Request the status."""

    command: Literal["status"] = "status"


class PublishComparisonRequest(_Line):
    """Publish the result of a comparison: the daemon's connection to the broker is the rover's only one."""

    command: Literal["publish-comparison"] = "publish-comparison"
    result: ComparisonResult


class Accepted(_Line):
    """The traverse begins."""

    event: Literal["accepted"] = "accepted"
    duration_s: float
    wheel_speed_rad_s: float


class Progress(_Line):
    """Progress of a traverse; `turned_m` is how far the wheels' rims have moved, as measured (their mean)."""

    event: Literal["progress"] = "progress"
    elapsed_s: float
    turned_m: float


class Ended(_Line):
    """The traverse is over."""

    event: Literal["ended"] = "ended"
    ending: Ending
    elapsed_s: float
    turned_m: float
    text: str


class Done(_Line):
    """The request was carried out."""

    event: Literal["done"] = "done"
    text: str


class Code(StrEnum):
    """Why a request was refused."""

    BAD_REQUEST = "bad-request"
    LIMIT = "limit"
    BUSY = "busy"
    NOT_READY = "not-ready"


class Refused(_Line):
    """The request was refused."""

    event: Literal["refused"] = "refused"
    code: Code
    text: str
    remedy: str = ""


class NodeLine(_Line):
    """One node in `Status`."""

    node_id: int
    kind: str
    wheel: int | None
    phase: str
    drive_state: str | None
    text: str


class Status(_Line):
    """Status of the daemon, the bus and the nodes."""

    event: Literal["status"] = "status"
    rover: str
    bus: str
    broker: str
    rate_Hz: float
    snapshots: int
    traverse: Progress | None
    nodes: tuple[NodeLine, ...]


Request = Annotated[
    TraverseRequest | StopRequest | StatusRequest | PublishComparisonRequest, Field(discriminator="command")
]
Reply = Annotated[Accepted | Progress | Ended | Done | Refused | Status, Field(discriminator="event")]
REQUEST: TypeAdapter[TraverseRequest | StopRequest | StatusRequest | PublishComparisonRequest] = TypeAdapter(Request)
REPLY: TypeAdapter[Accepted | Progress | Ended | Done | Refused | Status] = TypeAdapter(Reply)
