"""`regolithd mismatch` with recordings of several rovers: whose they are, what is written, and wrong calls."""

from __future__ import annotations

import json
import tomllib
from datetime import UTC, datetime, timedelta
from functools import partial
from hashlib import sha256
from types import SimpleNamespace
from typing import TYPE_CHECKING, NoReturn

import fleet_arm
import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import pytest
from typer.testing import CliRunner

from regolithd.calibration.mismatch.data.stretches import stretches_of
from regolithd.calibration.mismatch.errors import RecordingError
from regolithd.daemon.cli import app
from regolithd.daemon.mismatch import fleet
from regolithd.daemon.mismatch.fleet import RoverFile, begins_at, files_of_rovers, members_of, too_long_at_once
from regolithd.daemon.recording.mcap_file import DamagedRecordingError

if TYPE_CHECKING:
    from pathlib import Path

    from click.testing import Result


def call(*words: object) -> Result:
    """Run `regolithd mismatch`."""
    return CliRunner().invoke(app, ["mismatch", *map(str, words)])


@pytest.fixture
def two(tmp_path: Path) -> list[Path]:
    """Return a recording of each of two rovers, in a folder each; one of them has friction."""
    sound = fleet_arm.columns(1)
    worn = fleet_arm.columns(2, (0.3, 0.3))
    return [
        fleet_arm.write_recording(tmp_path / "asper" / "20260301.csv", sound, rover="asper"),
        fleet_arm.write_recording(tmp_path / "bruno" / "20260302.csv", worn, rover="bruno"),
    ]


def test_recordings_of_two_rovers_are_told_apart(two: list[Path], tmp_path: Path) -> None:
    """By their column, without an option; the catalogue and the answer say whose the friction is."""
    simulation, out = fleet_arm.write_simulation(tmp_path), tmp_path / "out.json"
    catalogue, report = tmp_path / "season.parquet", tmp_path / "season.html"
    done = call(*two, "--simulation", simulation, "--json", out, "--catalogue", catalogue, "--report", report)
    assert done.exit_code == 0, done.output
    (effect,) = json.loads(out.read_text())["effects"]
    assert (effect["name"], effect["rovers"]) == ("coulomb-friction", ["bruno"])
    assert {row["rover"] for row in pyarrow.parquet.read_table(catalogue).to_pylist()} == {"asper", "bruno"}
    assert len(list(catalogue.with_suffix(".parts").iterdir())) == 4
    page = report.read_text()
    assert effect["statement"][1:] in page.replace("\u00a0", " ")
    for path in two:
        assert f"<td>{path.name}</td><td><code>{sha256(path.read_bytes()).hexdigest()}</code></td>" in page


def test_a_corrected_simulation_is_of_the_rover_s_last_recording(tmp_path: Path) -> None:
    """What began half way is in it, and its last recording agrees with it."""
    drags = ((0.0, 0.0), (0.0, 0.0), (0.3, 0.3), (0.3, 0.3))
    paths = [
        fleet_arm.write_recording(tmp_path / f"2026030{day}.csv", fleet_arm.columns(day, drag), rover="asper")
        for day, drag in enumerate(drags, 1)
    ]
    new, out = tmp_path / "NEW.toml", tmp_path / "out.json"
    options = ("--catalogue", tmp_path / "season.parquet", "--corrected", new)
    done = call(*paths, "--simulation", fleet_arm.write_simulation(tmp_path), *options)
    assert done.exit_code == 0, done.output
    (written,) = tomllib.loads(new.read_text())["effects"]
    assert written["name"] == "coulomb-friction"
    assert written["coefficients"] == pytest.approx([0.3], rel=0.1)
    later = fleet_arm.write_recording(tmp_path / "20260309.csv", fleet_arm.columns(9, (0.3, 0.3)))
    done = call(later, "--simulation", new, "--json", out)
    assert done.exit_code == 0, done.output
    assert json.loads(out.read_text())["verdict"] == "consistent"


def test_a_file_may_hold_several_rovers(two: list[Path], tmp_path: Path) -> None:
    """Its rows are taken apart, and have the same content as a file for each."""
    both = tmp_path / "both.csv"
    pyarrow.csv.write_csv(pa.concat_tables([pyarrow.csv.read_csv(path) for path in two]), both)
    files = files_of_rovers([both], None)
    assert [file.rover for file in files] == ["asper", "bruno"]
    one, other = (members_of(each, "axis") for each in (files, files_of_rovers(two, None)))
    assert [member.name for member in one] == ["both.csv (asper)", "both.csv (bruno)"]
    for mine, apart in zip(one, other, strict=True):
        assert (mine.read().channels["torque_Nm"] == apart.read().channels["torque_Nm"]).all()


def test_the_folder_names_the_rover_where_asked(two: list[Path]) -> None:
    """The column is not looked at then."""
    assert [file.rover for file in files_of_rovers(two, "folder")] == ["asper", "bruno"]
    assert not any(file.of_column for file in files_of_rovers(two, "folder"))


def test_a_recording_that_has_to_say_whose_it_is_and_does_not_is_an_error(tmp_path: Path) -> None:
    """With the file and what it lacks."""
    path = fleet_arm.write_recording(tmp_path / "drive.csv", fleet_arm.columns(1))
    assert [file.rover for file in files_of_rovers([path], None)] == [""]
    with pytest.raises(RecordingError, match=r"drive\.csv does not say whose it is: it has no column"):
        files_of_rovers([path], "column")


def test_the_time_of_a_recording_is_in_its_name(two: list[Path]) -> None:
    """Where it is no MCAP file, which knows its time."""
    assert begins_at(two[0]) == datetime(2026, 3, 1, tzinfo=UTC)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--corrected", "NEW.toml"), "is of one rover"),
        (("--corrected", "NEW.toml", "--empirical"), "is of one rover"),
        (("--report", "nowhere/out.html"), "there is no folder"),
        (("--catalogue", "season.csv"), "name it .parquet"),
        (("--catalogue", "nowhere/season.parquet"), "there is no folder"),
    ],
)
def test_what_a_fleet_has_not_is_one_message(
    words: tuple[str, ...], told: str, two: list[Path], tmp_path: Path
) -> None:
    """And nothing is compared before."""
    words = (words[0], str(tmp_path / words[1]), *words[2:])
    done = call(*two, "--simulation", fleet_arm.write_simulation(tmp_path), *words)
    assert done.exit_code == 65
    assert told in done.output.replace("\n", " ")


def test_a_recording_of_the_daemon_names_its_rover_and_its_begin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the configuration in it, and by its first snapshot; damage leaves the name empty, and the file's date."""
    path = tmp_path / "rover-20260503T081500Z.mcap"
    path.touch()
    configured = json.dumps({"rover": {"name": "asper"}})
    monkeypatch.setattr(fleet, "read_metadata", lambda _: {"configuration": configured})
    assert files_of_rovers([path], None) == files_of_rovers([path], "metadata")
    assert [(file.rover, file.of_column) for file in files_of_rovers([path], None)] == [("asper", False)]
    with pytest.raises(RecordingError, match="it has no column that names a rover"):
        files_of_rovers([path], "column")
    monkeypatch.setattr(
        fleet, "recorded_snapshots", lambda _: iter([SimpleNamespace(time_ns=1_700_000_000_500_000_000)])
    )
    assert begins_at(path) == datetime(2023, 11, 14, 22, 13, 20, 500_000, tzinfo=UTC)
    for silent in ({}, {"configuration": "no JSON"}, {"configuration": "{}"}):
        monkeypatch.setattr(fleet, "read_metadata", lambda _, silent=silent: silent)
        assert [file.rover for file in files_of_rovers([path], None)] == [""]

    def damaged(_: object) -> NoReturn:
        raise DamagedRecordingError("damaged")

    monkeypatch.setattr(fleet, "read_metadata", damaged)
    monkeypatch.setattr(fleet, "recorded_snapshots", damaged)
    assert [file.rover for file in files_of_rovers([path], None)] == [""]
    assert begins_at(path) == datetime(2026, 5, 3, 8, 15, tzinfo=UTC)


def test_a_date_may_be_in_the_folder_s_name(tmp_path: Path) -> None:
    """Where the file's has none."""
    folder = tmp_path / "2026-07-01"
    folder.mkdir()
    (folder / "drive.csv").touch()
    assert begins_at(folder / "drive.csv") == datetime(2026, 7, 1, tzinfo=UTC)


def test_files_of_one_name_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    """Others keep the short name; a recording without a rover is of the only one."""
    paths = [tmp_path / folder / "drive.csv" for folder in ("a", "b")]
    for path in paths:
        path.parent.mkdir()
        path.write_text(path.parent.name)
    apart = members_of([RoverFile(path, "asper") for path in paths], "wheel")
    assert [member.name for member in apart] == [str(path) for path in paths]
    assert len({member.digest for member in apart}) == 2
    (alone,) = members_of([RoverFile(paths[0], "")], "wheel")
    assert (alone.name, alone.rover) == ("drive.csv", "rover")


def test_damaged_files_of_a_fleet_are_left_out(two: list[Path], tmp_path: Path) -> None:
    """Each with one note of the file, the cause and the cure, while the others are compared."""
    whole, out = two[1].read_bytes(), tmp_path / "out.json"
    damaged = {
        "cut.csv": (whole[: whole.rindex(b",")], "Complete the line or remove it"),
        "bytes.csv": (whole.replace(b"bruno", b"bru\xffo", 1), "Save the file as UTF-8"),
        "half.parquet": (b"PAR1" + whole[:1000], "Copy or export it again"),
    }
    for name, (content, _) in damaged.items():
        (tmp_path / name).write_bytes(content)
    paths = [*two, *(tmp_path / name for name in damaged)]
    done = call(*paths, "--simulation", fleet_arm.write_simulation(tmp_path), "--json", out)
    assert done.exit_code == 0, done.output
    answer = json.loads(out.read_text())
    assert [rover["name"] for rover in answer["rovers"]] == ["asper", "bruno"]
    for name, (_, cure) in damaged.items():
        (note,) = [note for note in answer["notes"] if name in note]
        assert note.startswith(f"{name} is left out: ")
        assert cure in note


def test_a_damaged_file_of_one_rover_is_an_error(two: list[Path], tmp_path: Path) -> None:
    """Its recordings are runs of one recording, which is not compared without one of them."""
    damaged = tmp_path / "cut.csv"
    damaged.write_bytes(two[0].read_bytes().rsplit(b",", 1)[0])
    done = call(two[0], damaged, "--simulation", fleet_arm.write_simulation(tmp_path))
    assert done.exit_code == 65
    assert "cut.csv, line" in done.output.replace("\n", "")


def test_a_recording_that_does_not_say_whose_it_is_among_those_that_do_is_noted(
    two: list[Path], tmp_path: Path
) -> None:
    """It is compared as one of a further rover."""
    out = tmp_path / "out.json"
    silent = fleet_arm.write_recording(tmp_path / "silent.csv", fleet_arm.columns(3))
    done = call(*two, silent, "--simulation", fleet_arm.write_simulation(tmp_path), "--json", out)
    assert done.exit_code == 0, done.output
    answer = json.loads(out.read_text())
    assert [rover["name"] for rover in answer["rovers"]] == ["asper", "bruno", "rover"]
    (note,) = [note for note in answer["notes"] if "whose" in note]
    assert note.startswith("silent.csv: ")


@pytest.mark.parametrize(("name", "told"), [("absent.csv", "is not there"), ("folder", "is not a file")])
def test_what_is_no_file_is_one_message(name: str, told: str, tmp_path: Path) -> None:
    """Before anything is read."""
    (tmp_path / "folder").mkdir()
    with pytest.raises(RecordingError, match=f"{name} {told}"):
        files_of_rovers([tmp_path / name], None)


def test_a_long_recording_is_compared_stretch_by_stretch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each stretch is a recording of its own, with the date at which it begins; a short one is read at once."""
    path = tmp_path / "drive-2026-05-03.parquet"
    columns = {"t_s": np.repeat(np.arange(1000.0), 2), "wheel": np.tile([1, 2], 1000), "current_A": np.arange(2000.0)}
    pyarrow.parquet.write_table(pa.table(columns), path)
    files = files_of_rovers([path], None)
    assert not too_long_at_once(files)
    (whole,) = members_of(files, "wheel")
    monkeypatch.setattr(fleet, "LONGEST_AT_ONCE", 1500)
    monkeypatch.setattr(fleet, "stretches_of", partial(stretches_of, rows=1000))
    assert too_long_at_once(files)
    first, second = members_of(files, "wheel")
    assert first.name == f"{path.name}, 0 min 0 s to 8 min 20 s"
    assert second.name == f"{path.name}, 8 min 20 s to 16 min 39 s"
    assert whole.begins
    assert second.begins == whole.begins + timedelta(seconds=500)
    assert len({whole.digest, first.digest, second.digest}) == 3
    np.testing.assert_array_equal(second.read().channels["current_A"].ravel(), np.arange(1000.0, 2000.0))
