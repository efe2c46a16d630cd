"""Compresses payloads. Each is small and alike, so the compressor starts with a dictionary of typical messages."""

from __future__ import annotations

import json
import zlib
from functools import cache

from regolithd.daemon.messages.channels import CHANNELS
from regolithd.daemon.messages.examples import example

LEVEL = 6
MARK_PLAIN, MARK_ZLIB = b"\x00", b"\x01"
"""First byte of a stored payload: how the rest is stored."""


@cache
def dictionary() -> bytes:
    """Return the examples of all messages, the most frequent last, as the compressor wants them."""
    names = ["snapshot", "posterior", "odometry"]
    ordered = sorted(CHANNELS, key=lambda channel: names.index(channel.name) if channel.name in names else -1)
    texts = [json.dumps(example(channel), separators=(",", ":"), ensure_ascii=False) for channel in reversed(ordered)]
    return "".join(texts).encode()[-32_768:]


def compress(payload: bytes, words: bytes) -> bytes:
    """Return a payload as it is stored; `words` is the store's dictionary."""
    compressor = zlib.compressobj(LEVEL, zlib.DEFLATED, -15, zdict=words)
    packed = compressor.compress(payload) + compressor.flush()
    return MARK_ZLIB + packed if len(packed) < len(payload) else MARK_PLAIN + payload


def decompress(stored: bytes, words: bytes) -> bytes:
    """Return the payload of what `compress` returned."""
    if stored[:1] == MARK_PLAIN:
        return stored[1:]
    decompressor = zlib.decompressobj(-15, zdict=words)
    return decompressor.decompress(stored[1:]) + decompressor.flush()
