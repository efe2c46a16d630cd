"""A damaged recording gives no number that was not recorded, and no traceback; what is missing is named."""

import json
import struct
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from regolithd.daemon.cli import app
from regolithd.daemon.recording.mcap_file import (
    DamagedRecordingError,
    McapFile,
    Recorded,
    is_closed,
    read_messages,
    read_metadata,
)
from regolithd.daemon.recording.mcap_records import McapScan

METADATA = {"configuration": "{}", "started_ns": "1"}
MESSAGES = 12


def write(path: Path, *, closed: bool = True) -> bytes:
    """Write a recording of three chunks, with two channels; return its bytes."""
    stream = path.open("wb")
    file = McapFile(stream, METADATA)
    for number in range(MESSAGES):
        topic = "event" if number % 3 == 0 else "snapshot"
        content = {"sequence": number, "time_ns": number, "load_N": [number / 7] * 6}
        file.write(topic, number, json.dumps(content).encode(), number)
        if number % 4 == 3:
            file.flush()
    if closed:
        file.close()
    stream.close()
    return path.read_bytes()


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, bytes, list[Recorded]]:
    """The bytes of a closed recording and of one of a killed daemon, and their messages."""
    path = tmp_path_factory.mktemp("recording") / "whole.mcap"
    killed = write(path, closed=False)
    closed = write(path)
    return closed, killed, list(read_messages(path))


def readable(path: Path) -> tuple[list[Recorded], list[str]]:
    """Return the messages that can be read, and the gaps."""
    gaps: list[str] = []
    return list(read_messages(path, on_gap=gaps.append)), gaps


def damage_second_chunk(path: Path) -> None:
    """Flip one bit of its compressed messages."""
    damaged = bytearray(path.read_bytes())
    first = damaged.index(b"zstd")
    damaged[damaged.index(b"zstd", first + 1) + 40] ^= 1
    path.write_bytes(damaged)


def test_a_whole_recording_has_no_gap(tmp_path: Path) -> None:
    """All messages and the metadata come back, whether the file was closed or the daemon was killed."""
    path = tmp_path / "a.mcap"
    for closed in (True, False):
        write(path, closed=closed)
        assert is_closed(path) is closed
        messages, gaps = readable(path)
        assert [message.content["sequence"] for message in messages] == list(range(MESSAGES))
        assert gaps == []
        assert read_metadata(path) == METADATA


def test_any_flipped_bit_in_a_closed_recording_is_named_and_alters_nothing(
    tmp_path: Path, recording: tuple[bytes, bytes, list[Recorded]]
) -> None:
    """Each message that is read was recorded so, in order; where one is missing, a gap is named."""
    whole, _, expected = recording
    path = tmp_path / "damaged.mcap"
    complete = 0
    for bit in range(0, 8 * len(whole), 17):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        messages, gaps = readable(path)
        assert messages == [message for message in expected if message in messages], bit
        complete += len(messages) == len(expected)
        assert gaps or len(messages) == len(expected), bit
        try:
            assert read_metadata(path).items() >= METADATA.items(), bit
        except DamagedRecordingError:
            assert gaps, bit
    assert complete > 100  # damage outside the messages costs none


def test_any_flipped_bit_in_a_recording_that_was_not_closed_alters_nothing(
    tmp_path: Path, recording: tuple[bytes, bytes, list[Recorded]]
) -> None:
    """A damaged length may look like the end of the file; then only the last messages are missing."""
    _, killed, expected = recording
    path = tmp_path / "damaged.mcap"
    for bit in range(0, 8 * len(killed), 17):
        damaged = bytearray(killed)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        messages, gaps = readable(path)
        assert messages == [message for message in expected if message in messages], bit
        if not gaps:
            assert messages == expected[: len(messages)], bit


def test_one_damaged_chunk_costs_its_own_messages_alone(
    tmp_path: Path, recording: tuple[bytes, bytes, list[Recorded]]
) -> None:
    """Even if it is the first, which defines the channels: the summary of the file defines them again."""
    whole, _, expected = recording
    path = tmp_path / "damaged.mcap"
    damaged = bytearray(whole)
    damaged[whole.index(b"zstd") + 40] ^= 0x10
    path.write_bytes(damaged)
    messages, gaps = readable(path)
    assert messages == expected[4:]
    assert len(gaps) == 1
    assert "is damaged and left out" in gaps[0]
    with pytest.raises(DamagedRecordingError, match="is damaged"):
        list(read_messages(path))


@settings(max_examples=80, deadline=None)
@given(data=st.data())
def test_no_damage_raises_or_invents(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Any bytes overwritten, inserted or removed give recorded messages only, and no other error."""
    path = tmp_path_factory.mktemp("damage") / "a.mcap"
    whole = write(path, closed=data.draw(st.booleans()))
    expected = list(read_messages(path))
    for _ in range(data.draw(st.integers(1, 3))):
        begin = data.draw(st.integers(0, len(whole)))
        end = data.draw(st.integers(begin, min(len(whole), begin + 60)))
        whole = whole[:begin] + data.draw(st.binary(max_size=60)) + whole[end:]
    path.write_bytes(whole)
    messages, _ = readable(path)
    assert all(message in expected for message in messages)


def test_export_names_the_gap_and_ends_with_status_1(tmp_path: Path) -> None:
    """What is not damaged is written."""
    path, out = tmp_path / "a.mcap", tmp_path / "a.csv"
    write(path)
    assert CliRunner().invoke(app, ["export", str(path), "--to", str(out)]).exit_code == 0
    rows = out.read_text().count("\n")
    damage_second_chunk(path)
    result = CliRunner().invoke(app, ["export", str(path), "--to", str(out)])
    assert result.exit_code == 1
    assert "is damaged and left out" in result.output
    assert "Traceback" not in result.output
    assert 1 < out.read_text().count("\n") < rows


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.parametrize("content", [b"", b"no recording at all"])
def test_an_export_without_rows_is_an_error(tmp_path: Path, suffix: str, content: bytes) -> None:
    """The exit status says so, and a message."""
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    result = CliRunner().invoke(app, ["export", str(path), "--to", str(tmp_path / f"out{suffix}")])
    assert result.exit_code == 1
    assert "0 rows" in result.output


@pytest.mark.parametrize("command", ["replay", "mismatch"])
def test_other_commands_end_with_one_message(tmp_path: Path, command: str, make_network: Callable[..., Path]) -> None:
    """A damaged recording is no traceback."""
    path = tmp_path / "a.mcap"
    write(path)
    damage_second_chunk(path)
    log = tmp_path / "a.log"
    log.write_text("(1.000000) can0 080# T\n")
    simulation = Path(__file__).parents[3] / "docs/examples/husky/SIM.toml"
    arguments = {
        "replay": ["replay", str(log), "--model", str(make_network())],
        "mismatch": ["mismatch", str(path), "--simulation", str(simulation)],
    }
    result = CliRunner().invoke(app, arguments[command])
    assert result.exit_code not in {0, 2}
    assert "is damaged" in result.output
    assert result.exception is None or isinstance(result.exception, SystemExit)


def test_an_index_that_cannot_be_read_is_named_once() -> None:
    """So is one of more messages than its chunk has; a readable index of as many says nothing."""
    told: list[str] = []
    scan = McapScan(told.append)
    scan._unindexed = 2
    channel, entries = struct.pack("<H", 1), struct.pack("<IQQQQ", 32, 5, 0, 6, 40)
    scan._check_index(channel + entries)
    assert (scan._unindexed, told) == (0, [])
    scan._check_index(channel + entries)
    scan._check_index(channel + entries)
    assert told == ["an index, or the chunk before it, is damaged at byte 0; messages may be missing"]
    other = McapScan(told.append)
    other._unindexed = 2
    other._check_index(b"\1")
    other._check_index(b"\1")
    assert len(told) == 3
