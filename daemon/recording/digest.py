"""A digest of estimates: equal digests mean that a live run and a replay gave the same numbers, bit by bit.

Only values are hashed, in a fixed order and encoding: a class or a field may be renamed and the digest stays.
"""

from __future__ import annotations

import hashlib
import struct
from dataclasses import astuple
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.daemon.pipeline.snapshot import Estimate


class Digest:
    """The SHA-256 of every value of the estimates that were added, and their `count`."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        self.count = 0

    def add(self, estimate: Estimate) -> None:
        """Take one more estimate."""
        for part in _parts(estimate):
            self._hash.update(part)
        self.count += 1

    def __str__(self) -> str:
        """Return the digest in hex."""
        return self._hash.hexdigest()


def _parts(estimate: Estimate) -> Iterator[bytes]:
    snapshot = estimate.snapshot
    yield struct.pack("<qq", snapshot.sequence, snapshot.time_ns)
    for array in (
        snapshot.values,
        estimate.wheel_torque_Nm,
        estimate.smoothed_torque_Nm,
        estimate.smoothed_load_N,
        estimate.slip,
        estimate.cohesion_Pa,
        estimate.friction_angle_rad,
    ):
        yield np.where(np.isnan(array), np.nan, array).astype("<f8").tobytes()  # one bit pattern for every NaN
    yield estimate.outside.tobytes()
    for source in estimate.slip_source:
        yield _encoded(source.value)
    for part in (estimate.posterior, estimate.soil_change):
        yield b"-" if part is None else b"+" + b"".join(_flattened(astuple(part)))


def _flattened(values: tuple[object, ...]) -> Iterator[bytes]:
    for value in values:
        if isinstance(value, tuple):
            yield from _flattened(value)
        else:
            yield _encoded(value)


def _encoded(value: object) -> bytes:
    """Return a tag for the type and the value: two values have the same bytes only where they are equal."""
    match value:
        case None:
            return b"n"
        case float():
            return b"f" + struct.pack("<d", value)
        case int():
            return b"i" + struct.pack("<q", value)
        case str():
            return b"s" + value.encode() + b"\0"
        case _:
            raise TypeError(f"no encoding for the digest: {value!r}")
