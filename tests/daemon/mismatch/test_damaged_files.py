"""Whatever happens to a file, `regolithd mismatch` has an answer or one message that names the file."""

from __future__ import annotations

from random import Random
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import pytest
from mutations import damaged_bytes, damaged_text
from rover_drives import TABLES, columns
from typer.testing import CliRunner

from regolithd.calibration.mismatch.corrected import stated_effects
from regolithd.calibration.mismatch.errors import MismatchError
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.simulation.load import load_simulation, read_tables
from regolithd.calibration.mismatch.templates import write_templates
from regolithd.calibration.toml_document import to_toml
from regolithd.daemon.cli import app
from regolithd.daemon.mismatch.recordings import read_recordings
from regolithd.daemon.pipeline.snapshot import ROW, Snapshot
from regolithd.daemon.recording.content import SNAPSHOT, snapshot_json
from regolithd.daemon.recording.mcap_file import McapFile

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

MUTATIONS = 1000
SAMPLED = 6
"""Mutations of each kind of file that go through the whole command."""
DRIVE = columns(length_s=16.0)
INSTANTS = len(DRIVE["t_s"]) // 6


@pytest.fixture(scope="module")
def rover(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder with a SIM.toml of the rover and a whole recording of each kind."""
    folder = tmp_path_factory.mktemp("rover")
    (folder / "SIM.toml").write_text(to_toml(TABLES))
    table = pa.table({name: np.round(values, 6) for name, values in DRIVE.items()})
    pyarrow.csv.write_csv(table, folder / "drive.csv", pyarrow.csv.WriteOptions(quoting_style="none"))
    pyarrow.parquet.write_table(table, folder / "drive.parquet")
    _write_mcap(folder / "drive.mcap", DRIVE)
    return folder


def _write_mcap(path: Path, table: dict[str, NDArray[np.float64]]) -> None:
    recording = McapFile(path.open("wb"), {})
    values = np.full((INSTANTS, len(ROW), 6), np.nan)
    for quantity, row in ROW.items():
        if quantity.name in table:
            values[:, row] = table[quantity.name].reshape(INSTANTS, 6)
    for k in range(INSTANTS):
        time_ns = 10**18 + round(1e9 * table["t_s"][6 * k])
        recording.write(SNAPSHOT, time_ns, snapshot_json(Snapshot(k, time_ns, values[k])))
        if k % 20 == 0:
            recording.flush()
    recording.close()


def _damaged(path: Path, random: Random) -> bytes:
    if path.suffix in {".csv", ".toml"}:
        return damaged_text(path.read_text(), random, "," if path.suffix == ".csv" else " ")
    return damaged_bytes(path.read_bytes(), random)


@pytest.mark.parametrize("kind", ["csv", "parquet", "mcap"])
def test_a_damaged_recording_is_a_problem_or_one_message(rover: Path, kind: str, tmp_path: Path) -> None:
    """Each of a thousand damaged files is compared with the simulation, or refused with a message that names it."""
    simulation, whole, path = load_simulation(rover / "SIM.toml"), rover / f"drive.{kind}", tmp_path / f"bad.{kind}"

    def use() -> Any:
        return build_problem(read_recordings([path], simulation.wheel_column), simulation)

    path.write_bytes(whole.read_bytes())
    assert use().mask.sum() > 100
    answers = sum(_answered(use, path, _damaged(whole, Random(seed)), seed) for seed in range(MUTATIONS))
    assert 0 < answers < MUTATIONS  # neither is everything refused, nor is nothing


@pytest.mark.parametrize("model", ["rover-wheel", "class"])
def test_a_damaged_simulation_is_loaded_or_one_message(rover: Path, model: str, tmp_path: Path) -> None:
    """Each of a thousand damaged SIM.toml predicts the recording, or is refused with a message."""
    write_templates(model, tmp_path)
    path = tmp_path / "SIM.toml"
    effects = '\n[[effects]]\nname = "coulomb-friction"\nshape = {}\ncoefficients = [0.01]\nwheels = [1, 2]\n'
    whole = path.read_text() + effects
    recordings = {
        "rover-wheel": read_recordings([rover / "drive.csv"], "wheel"),
        "class": read_recordings([_joint(tmp_path / "joint.csv")], "axis"),
    }

    def use() -> Any:
        tables = read_tables(path)
        simulation = load_simulation(path)
        stated_effects(tables)
        return build_problem(recordings[model], simulation)

    path.write_text(whole)
    assert use().mask.sum() >= 100
    answers = 0
    for seed in range(MUTATIONS // 2):
        answers += _answered(use, path, damaged_text(whole, Random(seed), " "), seed)
    assert 0 < answers < MUTATIONS // 2


def _joint(path: Path) -> Path:
    time_s = 0.02 * np.arange(200)
    speed = np.sin(time_s)
    table = {"t_s": time_s, "speed_rad_s": speed, "acceleration_rad_s2": np.cos(time_s), "torque_Nm": speed}
    pyarrow.csv.write_csv(pa.table(table), path)
    return path


def _answered(use: Callable[[], Any], path: Path, content: bytes, seed: int) -> bool:
    """Return whether a damaged file could be used; fail where it raises anything but the tool's own errors."""
    path.write_bytes(content)
    try:
        use()
    except MismatchError as error:
        if not str(error):
            raise AssertionError(f"seed {seed} has no message") from error
        return False
    except Exception as error:
        raise AssertionError(f"seed {seed} raised {type(error).__name__}: {error}") from error
    return True


@pytest.mark.parametrize("kind", ["csv", "parquet", "mcap", "toml"])
def test_the_command_answers_or_ends_with_one_message(rover: Path, kind: str, tmp_path: Path) -> None:
    """The command exits with 0 and an answer or with 65 and one message, and never with a traceback."""
    simulation = rover / "SIM.toml"
    whole = simulation if kind == "toml" else rover / f"drive.{kind}"
    path = tmp_path / f"bad.{kind}"
    for seed in range(SAMPLED):
        path.write_bytes(_damaged(whole, Random(10_000 + seed)))
        recording = rover / "drive.csv" if kind == "toml" else path
        chosen = path if kind == "toml" else simulation
        done = CliRunner().invoke(app, ["mismatch", str(recording), "--simulation", str(chosen)])
        assert done.exit_code in {0, 65}, f"seed {seed}: {done.exception!r}"
        assert done.exit_code == 0 or done.stderr.startswith("regolithd mismatch: "), done.stderr
