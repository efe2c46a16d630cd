"""What the ground accepts as a message."""

from __future__ import annotations

import pytest
from ground_messages import START_NS, received

from regolithd.daemon.ground.received import MessageError, parse


def test_a_message_has_its_rover_topic_key_and_time() -> None:
    """The time keeps its nanoseconds, and a topic may have several levels."""
    message = received("alarm/bus", 3, 0.123456789, rover="red-1")
    assert (message.rover, message.topic, message.channel) == ("red-1", "alarm/bus", "alarm")
    assert message.time_ns == START_NS + 123_456_789
    assert message.key == ("20261122T000000Z-aaaa", 3)


def test_a_death_has_a_key_of_its_own() -> None:
    """Birth and death of a connection have the same sequence; the death is the newer of the two."""
    birth, death = (received("state", 4, state=word) for word in ("online", "offline"))
    assert birth.key < death.key < received("state", 5, state="online").key


@pytest.mark.parametrize(
    "payload",
    [b"", b"\xff", b"[1, 2]", b"null", b"{}", b'{"session": 1, "sequence": 2, "time": "now"}', b'{"session": "a"'],
)
def test_anything_else_is_refused_by_name(payload: bytes) -> None:
    """The error names the topic and what is wrong."""
    with pytest.raises(MessageError, match="regolith/kapvik/event: not a message of regolithd: "):
        parse("regolith", "regolith/kapvik/event", payload)
