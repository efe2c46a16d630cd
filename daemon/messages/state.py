"""The `state` message: MQTT birth and death of one connection of the daemon."""

from __future__ import annotations

from enum import StrEnum
from typing import Literal

from regolithd.daemon.messages.header import Header


class Presence(StrEnum):
    """Whether the daemon is connected."""

    ONLINE = "online"
    OFFLINE = "offline"


class StateMessage(Header):
    """Birth and death of a connection: `offline` ends the `online` of the same `session` and `sequence`."""

    state: Presence
    reason: Literal["connected", "stopped", "failed", "connection-lost"]
    """`connection-lost` is the will, which the broker publishes; its `time` is that of the birth."""
    software_version: str
