"""`regolithd mismatch`: files to start from, several recordings, a corrected file in another folder, wrong calls."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pytest
from typer.testing import CliRunner

from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.mismatch.simulation.load import load_simulation
from regolithd.daemon.cli import app
from regolithd.daemon.mismatch import run

if TYPE_CHECKING:
    from pathlib import Path

    from click.testing import Result


def call(*words: object) -> Result:
    """Run `regolithd mismatch`."""
    return CliRunner().invoke(app, ["mismatch", *map(str, words)])


def joint(path: Path, seed: int, friction_Nm: float = 0.2) -> Path:
    """Write a recording of the template's joint, with a friction that the template lacks."""
    time_s = 0.02 * np.arange(1500)
    speed = np.sin((0.7 + 0.1 * seed) * time_s) + 0.6 * np.sin(1.9 * time_s)
    acceleration = np.gradient(speed, 0.02)
    noise = np.random.default_rng(seed).normal(0, 0.05, len(time_s))
    torque = 0.5 * acceleration + 0.2 * speed + friction_Nm * np.sign(speed) + noise
    columns = {"t_s": time_s, "torque_Nm": torque, "acceleration_rad_s2": acceleration, "speed_rad_s": speed}
    pyarrow.csv.write_csv(pa.table(columns), path)
    return path


@pytest.fixture
def start(tmp_path: Path) -> Path:
    """Return a folder with what `--init class` writes."""
    folder = tmp_path / "start"
    done = call("--init", "class", folder)
    assert done.exit_code == 0, done.output
    assert str(folder / "SIM.toml") in done.output.replace("\n", "")
    return folder


@pytest.mark.parametrize(("kind", "files"), [("rover-wheel", 1), ("class", 2), ("fmu", 1)])
def test_files_to_start_from_are_written(kind: str, files: int, tmp_path: Path) -> None:
    """No recording and no simulation are needed for that."""
    assert call("--init", kind, tmp_path / "new").exit_code == 0
    assert len(list((tmp_path / "new").iterdir())) == files


def test_code_that_a_simulation_names_is_announced_before_it_runs(start: Path, tmp_path: Path) -> None:
    """The sentence names module and folder, and stands before what the module itself does; a built-in one has none."""
    (module,) = start.glob("*.py")
    module.write_text("raise SystemExit('the module ran')\n")
    done = call(joint(tmp_path / "joint.csv", 1), "--simulation", start / "SIM.toml")
    announced, ran = done.output.find("running the code of "), done.output.find("the module ran")
    assert 0 <= announced < ran
    assert f"from {start}, which SIM.toml names: use only files that you trust" in done.output
    assert call("--init", "rover-wheel", tmp_path / "rover").exit_code == 0
    assert "running the code" not in call(tmp_path / "none.csv", "--simulation", tmp_path / "rover/SIM.toml").output


def test_files_to_start_from_replace_nothing(start: Path) -> None:
    """A second call, and an unknown kind, end with one message."""
    done = call("--init", "class", start)
    assert (done.exit_code, done.stderr.count("\n")) == (65, 1)
    assert "exists already" in done.stderr
    assert "--init takes rover-wheel, class, fmu" in call("--init", "matlab", start).stderr


def test_a_call_without_recording_or_simulation_is_told_what_is_missing() -> None:
    """Click's status for a wrong call is 2."""
    done = call("drive.csv")
    assert done.exit_code == 2
    assert "--simulation" in done.stderr


def test_effects_are_listed_with_law_needs_and_parameters() -> None:
    """Every effect of the library is there, and no recording is needed."""
    done = call("--effects")
    assert done.exit_code == 0
    assert "viscous-friction: drag that grows with speed\n  law         Δy = b sign(ω) |ω|^p\n" in done.output
    assert "  needs       a predicted column in A, mA, µA or kA\n" in done.output
    assert [each.name for each in library() if f"{each.name}: " not in done.output] == []


def test_the_effects_of_a_simulation_have_its_units(start: Path) -> None:
    """A coefficient is in the predicted column's unit; what cannot be in a column with that unit is not listed."""
    done = call("--effects", "--simulation", start / "SIM.toml")
    assert done.exit_code == 0
    assert "  parameters  quadratic_coefficient [N·m s²/rad²]\n" in done.output
    assert "current-sensor-bias" not in done.output


def test_recordings_are_compared_together(start: Path, tmp_path: Path) -> None:
    """Each is a run, its name is in the notes, and what is common to both is named."""
    recordings = [joint(tmp_path / f"{name}.csv", seed) for seed, name in enumerate("ab")]
    out = tmp_path / "out.json"
    done = call(*recordings, "--simulation", start / "SIM.toml", "--json", out, "--report", tmp_path / "r.html")
    assert done.exit_code == 0, done.output
    answer = json.loads(out.read_text())
    assert [effect["name"] for effect in answer["effects"]] == ["coulomb-friction"]
    assert {"a.csv: run 1.", "b.csv: run 2."} <= set(answer["notes"])
    assert "a.csv, b.csv" in (tmp_path / "r.html").read_text()


def test_a_corrected_file_in_another_folder_finds_the_class(start: Path, tmp_path: Path) -> None:
    """It says where the class is, relative to itself, and loads from there."""
    new = tmp_path / "results" / "june" / "NEW.toml"
    new.parent.mkdir(parents=True)
    done = call(joint(tmp_path / "a.csv", 0), "--simulation", start / "SIM.toml", "--corrected", new)
    assert done.exit_code == 0, done.output
    assert tomllib.loads(new.read_text())["simulation"] == {"model": "my_simulation:Joint", "path": "../../start"}
    assert load_simulation(new).channel == "torque_Nm"


@pytest.mark.parametrize(("probability", "lines"), [(0.03, 1), (0.97, 0), (None, 0)])
def test_a_corrected_file_of_an_improbable_answer_is_warned_of(
    probability: float | None, lines: int, start: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is written all the same, and the warning names it and the probability."""

    def less_sure(*given: object, **options: object) -> object:
        found = compare(*given, **options)  # type: ignore[arg-type]
        return replace(found, answer=replace(found.answer, probability=probability))

    monkeypatch.setattr(run, "compare", less_sure)
    new = tmp_path / "NEW.toml"
    done = call(joint(tmp_path / "a.csv", 0), "--simulation", start / "SIM.toml", "--corrected", new)
    assert (done.exit_code, new.exists()) == (0, True)
    assert done.stderr.count(f"{new}: it holds an answer with a probability of 0.03; ") == lines


def test_an_output_that_cannot_be_written_is_told_before_anything_is_computed(start: Path, tmp_path: Path) -> None:
    """The message names the folder."""
    done = call(tmp_path / "absent.csv", "--simulation", start / "SIM.toml", "--json", tmp_path / "no" / "out.json")
    assert done.exit_code == 65
    assert "there is no folder" in done.stderr


def test_a_missing_column_is_told_with_the_recording(start: Path, tmp_path: Path) -> None:
    """One message names the file and the column that was perhaps meant."""
    path = joint(tmp_path / "a.csv", 0)
    path.write_text(path.read_text().replace("torque_Nm", "torqe_Nm", 1))
    done = call(path, "--simulation", start / "SIM.toml")
    assert done.exit_code == 65
    assert done.stderr.endswith(
        f"regolithd mismatch: {path}: the simulation needs column torque_Nm, which the recording does not have; did "
        "you mean torqe_Nm?\n"
    )


def test_a_file_that_is_given_twice_is_an_error(start: Path, tmp_path: Path) -> None:
    """Its readings would count as two recordings, however it is spelled."""
    recording = joint(tmp_path / "joint.csv", 1)
    done = call(recording, tmp_path / "." / "joint.csv", "--simulation", start / "SIM.toml")
    assert (done.exit_code, done.stderr.splitlines()[-1].count("is given twice")) == (65, 1)


def test_a_copy_of_a_file_is_an_error(start: Path, tmp_path: Path) -> None:
    """Under another name, or another date, its readings would count as two recordings as well."""
    recording, copy = joint(tmp_path / "2026-05-01.csv", 1), tmp_path / "2026-05-02.csv"
    other = joint(tmp_path / "2026-05-03.csv", 2)
    copy.write_bytes(recording.read_bytes())
    done = call(recording, other, copy, "--simulation", start / "SIM.toml")
    message = f"regolithd mismatch: {copy} is a copy of {recording}: the same readings would count as two recordings."
    assert (done.exit_code, done.stderr.splitlines()[-1]) == (65, f"{message} Leave one out")


def test_an_answer_that_a_corrected_file_cannot_hold_is_printed_all_the_same(start: Path, tmp_path: Path) -> None:
    """What is unexplained over time has no curve for another recording; answer and report are there nevertheless."""
    path = joint(tmp_path / "joint.csv", 1, friction_Nm=0.0)
    table = pyarrow.csv.read_csv(path).to_pydict()
    spells = np.isin(np.arange(1500) // 100, (2, 3, 7, 11, 12))
    table["torque_Nm"] = np.array(table["torque_Nm"]) + 0.4 * spells
    pyarrow.csv.write_csv(pa.table(table), path)
    new, report = tmp_path / "NEW.toml", tmp_path / "report.html"
    options = ("--simulation", start / "SIM.toml", "--corrected", new, "--empirical", "--report", report)
    done = call(path, *options)
    assert done.exit_code == 65
    assert done.stdout.splitlines()[0].strip().startswith("unexplained")
    assert f"{new} is not written: --empirical: what is unexplained follows time" in done.stderr.replace("\n", "")
    assert report.exists()
    assert not new.exists()


def test_a_wheel_of_a_corrected_effect_that_is_not_recorded_is_told(start: Path, tmp_path: Path) -> None:
    """A misspelt name would correct nothing, silently."""
    text = (start / "SIM.toml").read_text() + (
        '\n[[effects]]\nname = "coulomb-friction"\nshape = {}\ncoefficients = [0.2]\nwheels = ["elbow"]\n'
    )
    (start / "SIM.toml").write_text(text)
    done = call(joint(tmp_path / "joint.csv", 1), "--simulation", start / "SIM.toml")
    assert done.exit_code == 0
    assert "coulomb-friction is corrected on elbow, which the recording does not have: it has 1" in done.stdout


@pytest.mark.parametrize(("name", "told"), [("time_s", True), ("Timestamp", True), ("torque_V", False)])
def test_a_column_that_is_likely_the_time_is_named(name: str, told: bool, start: Path, tmp_path: Path) -> None:
    """One message says what the column of time is called, and which it may be."""
    path = joint(tmp_path / "joint.csv", 1)
    path.write_text(path.read_text().replace('"t_s"', f'"{name}"', 1))
    done = call(path, "--simulation", start / "SIM.toml")
    assert done.exit_code == 65
    assert "there is no column of time (t_s, t_ms," in done.stderr
    assert (f"if {name} is the time in seconds, name it t_s" in done.stderr) is told
