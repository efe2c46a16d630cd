"""An export replaces the earlier file as a whole, or not at all, and says why."""

from __future__ import annotations

import errno
import json
from typing import TYPE_CHECKING

import pytest
from typer.testing import CliRunner

from regolithd.daemon.cli import app
from regolithd.daemon.recording.mcap_file import McapFile
from regolithd.daemon.recording.replacement import ExportError, replacing

if TYPE_CHECKING:
    from pathlib import Path

FORMATS = (["a.csv"], ["a.parquet"], ["a.csv", "--everything"], ["a.parquet", "--everything"], ["a.nc"])


def recorded(path: Path, begin_ns: int = 1) -> Path:
    """Write a recording of three snapshots."""
    file = McapFile(path.open("wb"), {})
    for number in range(3):
        time_ns = begin_ns + number
        content = {"sequence": number, "time_ns": time_ns, "load_N_1": 50.0}
        file.write("snapshot", time_ns, json.dumps(content).encode(), number)
    file.close()
    return path


def run(*arguments: object) -> tuple[int, str]:
    """Return the exit status of `regolithd export` and what it printed."""
    done = CliRunner().invoke(app, ["export", *map(str, arguments)])
    assert done.exception is None or isinstance(done.exception, SystemExit)
    return done.exit_code, done.output


def interrupted(out: Path, error: BaseException) -> None:
    """Write half a file in the place of `out`, and fail."""
    with replacing(out) as beside:
        beside.write_text("half")
        raise error


@pytest.mark.parametrize("to", FORMATS)
def test_a_failed_export_leaves_the_earlier_file(tmp_path: Path, to: list[str]) -> None:
    """Of a recording without a byte, which is named, nothing is written, and nothing stays beside the file."""
    out = tmp_path / to[0]
    assert run(recorded(tmp_path / "whole.mcap"), "--to", out, *to[1:])[0] == 0
    earlier = out.read_bytes()
    (tmp_path / "empty.mcap").touch()
    status, said = run(tmp_path / "empty.mcap", "--to", out, *to[1:])
    assert status == 1
    assert "empty.mcap: is empty: 0 bytes." in said
    assert "a.csv: 0 rows" in said.replace("a.parquet", "a.csv").replace("a.nc", "a.csv")
    assert out.read_bytes() == earlier
    assert {path.name for path in tmp_path.iterdir()} == {"whole.mcap", "empty.mcap", to[0]}


def test_an_interrupted_export_leaves_the_earlier_file(tmp_path: Path) -> None:
    """Whatever ends it, the link and the file that it leads to stay, and a full disk is named with what to do."""
    out, link = tmp_path / "a.csv", tmp_path / "link.csv"
    out.write_text("earlier")
    link.symlink_to(out)
    for error, raised, told in (
        (KeyboardInterrupt(), KeyboardInterrupt, None),
        (OSError(errno.ENOSPC, "No space left on device"), ExportError, "link.csv: .*No space left .* Free space"),
        (OSError(errno.EIO, "Input/output error"), OSError, "Input/output error"),
    ):
        with pytest.raises(raised, match=told):
            interrupted(link, error)
        assert out.read_text() == "earlier"
        assert set(tmp_path.iterdir()) == {out, link}
    with replacing(link) as beside:
        beside.write_text("new")
    assert (out.read_text(), link.is_symlink()) == ("new", True)


def test_a_place_that_is_no_file_is_named_with_what_to_do(tmp_path: Path) -> None:
    """A folder that is missing, a folder in the file's place, and a format that is not known."""
    recording = recorded(tmp_path / "whole.mcap")
    (tmp_path / "folder.csv").mkdir()
    for to, told in (
        ("none/a.csv", f"there is no folder {tmp_path}/none. Create it, or correct --to."),
        ("folder.csv", "this is a folder. Name a file in it with --to."),
        ("a.xlsx", "the suffix '.xlsx' is not supported. Name it .csv, .parquet or .nc."),
    ):
        assert run(recording, "--to", tmp_path / to) == (1, f"{tmp_path / to}: {told}\n")


def test_a_recording_twice_is_refused_and_another_order_is_told(tmp_path: Path) -> None:
    """The rows of the first would be there twice; those of the second are, in the order of the files."""
    first, second = recorded(tmp_path / "1.mcap"), recorded(tmp_path / "2.mcap", 10)
    empty = tmp_path / "3.mcap"
    empty.touch()
    status, said = run(first, tmp_path / "." / "1.mcap", "--to", tmp_path / "a.csv")
    assert (status, (tmp_path / "a.csv").exists()) == (2, False)
    assert "named twice" in said
    status, said = run(second, empty, first, "--to", tmp_path / "a.csv")
    assert status == 0
    assert f"{first}: begins before {second}" in said
    assert "begins before" not in run(first, empty, second, "--to", tmp_path / "a.csv")[1]
