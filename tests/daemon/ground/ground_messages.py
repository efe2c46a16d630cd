"""Messages as the ground receives them, made from the examples."""

from __future__ import annotations

import json
from typing import Any

from regolithd.daemon.ground.received import Received, parse
from regolithd.daemon.messages.channels import CHANNELS
from regolithd.daemon.messages.examples import example
from regolithd.daemon.messages.header import time_fields

EXAMPLES = {channel.name: example(channel) for channel in CHANNELS}
START_NS = 1_700_000_000_000_000_000
SESSION = "20261122T000000Z-aaaa"


def received(topic: str, sequence: int, time_s: float = 0.0, rover: str = "kapvik", **fields: Any) -> Received:
    """Return an example message of a topic, `time_s` seconds after the start, with these fields."""
    moment = time_fields(START_NS + round(time_s * 1e9))
    content = EXAMPLES[topic.split("/", maxsplit=1)[0]] | moment | {"session": SESSION, "sequence": sequence} | fields
    return parse("regolith", f"regolith/{rover}/{topic}", json.dumps(content).encode())
