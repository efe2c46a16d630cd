"""Every MQTT topic of the daemon: its message, quality of service, retain flag, and whether it is stored.

The JSON Schemas, the AsyncAPI document and the table in `docs/messages/` are generated from here (`regolithd schema`).
docs/decisions/020 and 021 give the reasons for the qualities of service.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

from regolithd.daemon.messages.alarm import AlarmMessage
from regolithd.daemon.messages.bus import EmergencyMessage, EventMessage, NodeMessage
from regolithd.daemon.messages.health import HealthMessage
from regolithd.daemon.messages.measurements import SnapshotMessage, WheelMessage
from regolithd.daemon.messages.mismatch import MismatchMessage, ReportMessage
from regolithd.daemon.messages.odometry import OdometryMessage
from regolithd.daemon.messages.posterior import PosteriorMessage
from regolithd.daemon.messages.state import StateMessage

if TYPE_CHECKING:
    from regolithd.daemon.messages.header import Header


class QoS(IntEnum):
    """MQTT's quality of service."""

    AT_MOST_ONCE = 0
    AT_LEAST_ONCE = 1


@dataclass(frozen=True, slots=True)
class Channel:
    """A topic below `<prefix>/<rover>/`.

    Attributes
    ----------
    name
        Short name, also that of its schema file.
    address
        The topic, with parameters in braces.
    message
        The model of its payload.
    qos, retain
        As MQTT defines them; a late message is never retained.
    stored
        Whether a message is kept on disk until the broker has acknowledged it, then sent in order, marked `late`.
    when
        When it is published, for the documents.
    """

    name: str
    address: str
    message: type[Header]
    qos: QoS
    retain: bool
    stored: bool
    when: str


_ONCE, _ACKNOWLEDGED = QoS.AT_MOST_ONCE, QoS.AT_LEAST_ONCE

_POSTERIOR = "twice a second while wheels turn, and for `[posterior] window_s` after"
"""Its window then holds what was measured before."""

CHANNELS = (
    Channel("state", "state", StateMessage, _ACKNOWLEDGED, True, False, "at the start and end of each connection"),
    Channel("snapshot", "snapshot", SnapshotMessage, _ACKNOWLEDGED, False, True, "at each SYNC, in order"),
    Channel("wheel", "wheel/{wheel}", WheelMessage, _ONCE, False, False, "up to 20 times a second, while connected"),
    Channel("posterior", "posterior", PosteriorMessage, _ACKNOWLEDGED, False, True, _POSTERIOR),
    Channel("odometry", "odometry", OdometryMessage, _ACKNOWLEDGED, False, True, "twice a second while wheels turn"),
    Channel("node", "node/{node_id}", NodeMessage, _ACKNOWLEDGED, True, True, "when the node's state changes"),
    Channel("emcy", "emcy", EmergencyMessage, _ACKNOWLEDGED, False, True, "when a node sends one"),
    Channel("event", "event", EventMessage, _ACKNOWLEDGED, False, True, "when it happens"),
    Channel("alarm", "alarm/{name}", AlarmMessage, _ACKNOWLEDGED, True, True, "when it begins and ends"),
    Channel("mismatch", "mismatch", MismatchMessage, _ACKNOWLEDGED, True, True, "after each traverse, if set up"),
    Channel("report", "report", ReportMessage, _ACKNOWLEDGED, True, True, "after each traverse, if set up"),
    Channel("health", "health", HealthMessage, _ONCE, False, False, "once a second, while connected"),
)
