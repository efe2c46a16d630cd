"""One message of a rover as the ground received it, checked as far as the ground relies on it."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import from_json

from regolithd.daemon.messages.channels import CHANNELS
from regolithd.daemon.messages.header import Time  # noqa: TC001  # pydantic reads it

STORED = frozenset(channel.name for channel in CHANNELS if channel.qos)
"""The channels that are subscribed with QoS 1 and stored: all that arrive at least once."""
STATE = "state"


class _Header(BaseModel):
    """The fields that every message begins with; those of a newer daemon are ignored."""

    model_config = ConfigDict(extra="ignore", strict=True)

    session: str
    sequence: int
    time: Time
    late: bool = False
    state: str | None = None


class MessageError(ValueError):
    """A payload that no daemon of this project sends."""


@dataclass(frozen=True, slots=True)
class Received:
    """A message.

    Attributes
    ----------
    rover, topic
        The rover's name, and the topic below it: `alarm/bus`.
    session, sequence
        Its key within the topic. The death message of a connection has the key of its birth message: hence births count
        as 2 n, deaths as 2 n + 1.
    time_ns
        Time of the rover's clock.
    late
        Whether it comes from the rover's store.
    payload
        JSON, as received.
    content
        The parsed payload.
    """

    rover: str
    topic: str
    session: str
    sequence: int
    time_ns: int
    late: bool
    payload: bytes
    content: dict[str, Any]

    @property
    def channel(self) -> str:
        """The topic's first level, which names the kind of message."""
        return self.topic.split("/", 1)[0]

    @property
    def key(self) -> tuple[str, int]:
        """Session and sequence: of two messages on a topic the one with the larger key is newer."""
        return self.session, self.sequence


def parse(prefix: str, topic: str, payload: bytes) -> Received:
    """Return the message of a topic and payload.

    Raises
    ------
    MessageError
        The topic or the payload is none of this project's.
    """
    rover, _, below = topic.removeprefix(f"{prefix}/").partition("/")
    try:
        content = from_json(payload)
        header = _Header.model_validate(content)
    except (ValueError, ValidationError) as error:
        raise MessageError(f"{topic}: not a message of regolithd: {_first_line(error)}") from error
    sequence = header.sequence
    if below == STATE:
        sequence = 2 * sequence + (header.state == "offline")
    return Received(rover, below, header.session, sequence, _time_ns(header.time), header.late, payload, content)


def _time_ns(text: str) -> int:
    """Return a time of the format `Time` in ns since 1970."""
    second = datetime.fromisoformat(f"{text[:19]}+00:00")
    return int(second.timestamp()) * 1_000_000_000 + int(text[20:29])


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0] if not isinstance(error, ValidationError) else _missing(error)


def _missing(error: ValidationError) -> str:
    first = error.errors()[0]
    return f"{'.'.join(str(part) for part in first['loc'])}: {first['msg']}"
