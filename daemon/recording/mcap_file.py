"""One MCAP file: snapshots, estimates and events as JSON, in chunks that are closed on every flush.

MCAP writes a chunk when it is full and the index at the end, so a killed process leaves a file without its last chunk
and without index. Here `flush` ends a chunk twice a second; `read_messages` reads all complete chunks, without the
index, and checks them (`mcap_records`).
"""

from __future__ import annotations

import json
import zlib
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING, Any, NoReturn

from mcap.records import Channel, Message, Metadata
from mcap.writer import CompressionType, Writer

from regolithd.daemon.recording.mcap_records import McapScan, closed_and_size, summary_channels

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from contextlib import AbstractContextManager
    from pathlib import Path

_CHECKSUM = "crc32"
"""Key of the metadata that holds a checksum of the others: MCAP has none for them."""

_SCHEMA = json.dumps({"type": "object"}).encode()


class DamagedRecordingError(Exception):
    """A recording is damaged; the message says which file, and where."""


class McapFile:
    """An MCAP file being written; `stream` is closed with it. `schema` returns the JSON Schema of a topic."""

    def __init__(
        self, stream: IO[bytes], metadata: Mapping[str, str], schema: Callable[[str], bytes] = lambda _topic: _SCHEMA
    ) -> None:
        self._stream = stream
        self._schema = schema
        self._writer = Writer(stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
        self._writer.start(profile="regolithd")
        self._writer.add_metadata("regolithd", {**metadata, _CHECKSUM: _checksum(metadata)})
        self._channels: dict[str, int] = {}

    def write(self, topic: str, time_ns: int, content: bytes, sequence: int = 0) -> None:
        """Append one JSON message."""
        channel = self._channels.get(topic)
        if channel is None:
            schema = self._writer.register_schema(topic, "jsonschema", self._schema(topic))
            channel = self._channels[topic] = self._writer.register_channel(topic, "json", schema)
        self._writer.add_message(channel, time_ns, content, time_ns, sequence)

    def flush(self) -> None:
        """Close the chunk and write everything to the kernel, so that it survives this process."""
        self._writer.flush()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """Write the index and close."""
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]
        finally:
            self._stream.close()

    @property
    def size(self) -> int:
        """Bytes written so far."""
        return self._stream.tell()


@dataclass(frozen=True, slots=True)
class Recorded:
    """One message of a recording; `content` is parsed JSON."""

    topic: str
    time_ns: int
    content: dict[str, Any]


def open_mcap(path: Path) -> AbstractContextManager[IO[bytes]]:
    """Open a file for reading."""
    return path.open("rb")


class MessageReader:
    """Reads the messages of a file, which may still be written to.

    Parameters
    ----------
    opening: opens it for reading, each time
    on_gap: called with a text for everything damaged that is left out
    """

    def __init__(
        self,
        path: Path,
        opening: Callable[[Path], AbstractContextManager[IO[bytes]]] = open_mcap,
        on_gap: Callable[[str], None] | None = None,
    ) -> None:
        self._path, self._opening = path, opening
        self._report = _reporter(path, on_gap)
        self._scan = McapScan(self._report)
        self._topics: dict[int, str] = {}

    @property
    def ended(self) -> bool:
        """Whether no more will come: the file was closed, or nothing can be read behind what is damaged."""
        return self._scan.ended

    def messages(self) -> Iterator[Recorded]:
        """Yield the messages of all complete chunks, in their order; called again, those that have come since.

        Raises
        ------
        DamagedRecordingError
            Something is damaged, and there is no `on_gap`.
        """
        topics = self._topics
        with self._opening(self._path) as stream:
            for record in self._scan.records(stream):
                if isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Message):
                    if record.channel_id not in topics:  # it was defined in a damaged chunk
                        topics |= _channels(self._path)
                    if topic := topics.get(record.channel_id):
                        yield Recorded(topic, record.log_time, json.loads(record.data))
                    else:
                        topics[record.channel_id] = ""
                        self._report(
                            f"the messages of channel {record.channel_id} are left out: its definition is damaged"
                        )


def read_messages(
    path: Path,
    opening: Callable[[Path], AbstractContextManager[IO[bytes]]] = open_mcap,
    on_gap: Callable[[str], None] | None = None,
) -> Iterator[Recorded]:
    """Yield the messages of all complete chunks of a file, in their order.

    `on_gap` is called with a text for everything damaged that is left out.

    Raises
    ------
    DamagedRecordingError
        Something is damaged, and there is no `on_gap`.
    """
    yield from MessageReader(path, opening, on_gap).messages()


def read_metadata(path: Path) -> dict[str, str]:
    """Return the metadata that were written at the start of the recording; empty where there are none.

    Raises
    ------
    DamagedRecordingError
        They, or the file's begin, are damaged.
    """
    report = _reporter(path, None)
    with open_mcap(path) as stream:
        records = McapScan(report).records(stream)
        metadata = next((dict(record.metadata) for record in records if isinstance(record, Metadata)), {})
    checksum = metadata.pop(_CHECKSUM, None)
    if checksum not in {None, _checksum(metadata)}:
        report("the metadata are damaged")
    return metadata


def is_closed(path: Path) -> bool:
    """Return whether the file was closed: not where the daemon was killed, or still records."""
    with open_mcap(path) as stream:
        return closed_and_size(stream)[0]


def incomplete(path: Path) -> str:
    """Return that the file is empty, or that its end may be missing; an empty text where it is complete."""
    if not path.stat().st_size:
        return f"{path}: is empty: 0 bytes."
    return "" if is_closed(path) else f"{path}: was not closed; what was recorded last may be missing."


def first_time(path: Path) -> int:
    """Return the time of the first message that can be read, in nanoseconds since 1970; 0 where there is none."""
    return next((message.time_ns for message in read_messages(path, on_gap=lambda _: None)), 0)


def _reporter(path: Path, on_gap: Callable[[str], None] | None) -> Callable[[str], None]:
    def fail(text: str) -> NoReturn:
        raise DamagedRecordingError(f"{path}: {text}.")

    return fail if on_gap is None else lambda text: on_gap(f"{path}: {text}.")


def _channels(path: Path) -> dict[int, str]:
    with open_mcap(path) as stream:
        return summary_channels(stream)


def _checksum(metadata: Mapping[str, str]) -> str:
    content = json.dumps(dict(metadata), sort_keys=True)
    return f"{zlib.crc32(content.encode()):08x}"
