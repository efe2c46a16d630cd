"""`regolithd replay` of a log alone: nothing is assumed silently, and nothing compared is not a success."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import pytest
from recorded_traverse import drive_traverse
from typer.testing import CliRunner

from regolithd.daemon.cli import app

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
    assert "compared   with nothing: no alone.mcap beside the log" in done.output
    assert "identical" not in done.output


def test_a_log_without_a_snapshot_is_an_error(folder: Path) -> None:
    """Status 1, with a configuration as well."""
    done = CliRunner().invoke(app, ["replay", str(folder / "empty.log"), "--config", str(folder / "rover.toml")])
    assert done.exit_code == 1
    assert "snapshots  0" in done.output


def test_beside_its_recording_every_message_is_the_same(folder: Path) -> None:
    """The numbers are found by the log's name."""
    (log,) = (folder / "recordings").glob("*.log")
    done = CliRunner().invoke(app, ["replay", str(log), "--config", str(folder / "rover.toml")])
    assert done.exit_code == 0, done.output
    assert "identical  to the last bit with the 120 messages" in done.output
