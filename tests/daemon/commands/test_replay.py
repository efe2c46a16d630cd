"""`regolithd replay` of a log alone: nothing is assumed silently, and nothing compared is not a success."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import pytest
from recorded_traverse import drive_traverse
from typer.testing import CliRunner

from regolithd.daemon.cli import app
from regolithd.daemon.recording.mcap_records import MAGIC

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded half minute, its `rover.toml`, and a copy of the log alone."""
    folder = tmp_path_factory.mktemp("drive")
    (log,) = drive_traverse(folder, 1, 30.0, 0.0).recording.directory.glob("*.log")
    shutil.copy(log, folder / "alone.log")
    (folder / "empty.log").touch()
    return folder


def test_a_log_without_its_recording_needs_a_configuration(folder: Path) -> None:
    """The defaults are not taken for the rover's: the file that is missing is named, with what to give instead."""
    done = CliRunner().invoke(app, ["replay", str(folder / "alone.log")])
    assert done.exit_code == 78
    assert "alone.mcap is not there" in done.output
    assert "--config" in done.output


def test_with_a_configuration_it_is_replayed_and_said_that_nothing_was_compared(folder: Path) -> None:
    """The digest is what was asked for."""
    done = CliRunner().invoke(app, ["replay", str(folder / "alone.log"), "--config", str(folder / "rover.toml")])
    assert done.exit_code == 0, done.output
    assert "snapshots  60" in done.output
    assert "compared   with nothing: no .mcap beside the logs" in done.output
    assert "identical" not in done.output


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("empty.log", b"", "it is empty: 0 bytes."),
        ("noise.log", b"\x00\xff\n" * 50, "no line of it is that of a candump log"),
        ("alone.mcap", MAGIC + b"\x01", "this is an MCAP file. Give the candump log beside it: "),
    ],
)
def test_a_log_without_a_frame_is_one_error(folder: Path, tmp_path: Path, name: str, content: bytes, told: str) -> None:
    """It is named with what to give instead, and not called different from the recording."""
    (tmp_path / name).write_bytes(content)
    done = CliRunner().invoke(app, ["replay", str(tmp_path / name), "--config", str(folder / "rover.toml")])
    assert done.exit_code == 1
    assert done.output.startswith(f"{tmp_path / name}: {told}")
    assert done.output.count("\n") == 1


def test_an_empty_log_beside_others_is_told_and_left_out(folder: Path) -> None:
    """A daemon that is killed at its start leaves one."""
    logs = [str(folder / "empty.log"), str(folder / "alone.log")]
    done = CliRunner().invoke(app, ["replay", *logs, "--config", str(folder / "rover.toml")])
    assert done.exit_code == 0
    assert "empty.log: is empty: 0 bytes." in done.output
    assert "snapshots  60" in done.output


def copied(folder: Path, to: Path) -> tuple[Path, Path, list[str]]:
    """Copy the recording; return log and MCAP file, and the command that replays them."""
    (original,) = (folder / "recordings").glob("*.log")
    log, mcap = to / "drive.log", to / "drive.mcap"
    shutil.copy(original, log)
    shutil.copy(original.with_suffix(".mcap"), mcap)
    return log, mcap, ["replay", str(log), "--config", str(folder / "rover.toml")]


def test_lines_that_cannot_be_read_are_counted(folder: Path, tmp_path: Path) -> None:
    """The rest is replayed; the incomplete last line that a killed daemon leaves is no damage."""
    log, _, command = copied(folder, tmp_path)
    whole = log.read_text()
    log.write_text(whole + "(1436509052.2497")
    assert CliRunner().invoke(app, command).exit_code == 0
    first, rest = whole.split("\n", 1)
    log.write_text(f"{first}\nnoise\nmore noise\n{rest}")
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 1
    assert f"{log}: 2 lines that cannot be read are left out, the first is line 2." in done.output
    assert "identical  to the last bit with the 120 messages" in done.output


def test_a_recording_that_ends_early_is_compared_as_far_as_it_goes(folder: Path, tmp_path: Path) -> None:
    """How much was not compared is told, and that the file was not closed."""
    _, mcap, command = copied(folder, tmp_path)
    mcap.write_bytes(mcap.read_bytes()[: mcap.stat().st_size // 2])
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    assert f"{mcap}: was not closed" in done.output
    compared = int(done.output.split("last bit with the ")[1].split()[0])
    assert 0 < compared < 120
    assert f"not compared: {120 - compared} of the 120 messages" in done.output


def test_a_damaged_chunk_is_left_out_and_the_rest_compared(folder: Path, tmp_path: Path) -> None:
    """It is named, and the exit status is 1, as of an export."""
    _, mcap, command = copied(folder, tmp_path)
    damaged = bytearray(mcap.read_bytes())
    second = damaged.index(b"zstd", damaged.index(b"zstd") + 1)
    damaged[second + 60] ^= 1
    mcap.write_bytes(damaged)
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 1
    assert "is damaged and left out" in done.output
    assert "identical  to the last bit" in done.output
    assert "not compared: " in done.output


def test_beside_its_recording_every_message_is_the_same(folder: Path) -> None:
    """The numbers are found by the log's name."""
    (log,) = (folder / "recordings").glob("*.log")
    done = CliRunner().invoke(app, ["replay", str(log), "--config", str(folder / "rover.toml")])
    assert done.exit_code == 0, done.output
    assert "identical  to the last bit with the 120 messages" in done.output
