"""After any change of a file the whole command gives an answer of the schema, a report and a file, or one message.

`make mutations` tries a thousand changes of each kind (MUTATIONS=1000); the suite tries fewer.
"""

from __future__ import annotations

import json
import os
import shutil
from random import Random
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import pytest
from jsonschema import Draft202012Validator
from mutations import damaged_bytes, damaged_text
from structural_mutations import damaged_json, damaged_table, damaged_value
from typer.testing import CliRunner

from regolithd.calibration.mismatch import load_simulation
from regolithd.calibration.mismatch.answer import answer_schema
from regolithd.daemon.cli import app
from regolithd.daemon.pipeline.snapshot import ROW, Snapshot
from regolithd.daemon.recording.content import SNAPSHOT, snapshot_json
from regolithd.daemon.recording.mcap_file import McapFile

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

MUTATIONS = int(os.environ.get("MUTATIONS", "25"))
INSTANTS, STEP_S = 150, 0.2
SCHEMA = Draft202012Validator(answer_schema())
MODULE = """
import numpy as np
from regolithd.calibration.mismatch import Prior, Simulation

class Drive(Simulation):
    channel, unit = "motor_current_A", "A"
    inputs = ("load_N",)
    parameters = {"rolling_A_per_N": Prior(0.004, 0.001, "A/N"), "offset_A": Prior(0.0, 0.01, "A")}
    own_tables = ("camera",)

    def predict(self, inputs, values):
        return values["rolling_A_per_N"] * inputs["load_N"] + values["offset_A"]

    def covariates(self, inputs):
        return {"wheel_speed": inputs["motor_speed_rad_s"]}

    def candidates(self, library):
        return [each for each in library if each.name in {"coulomb-friction", "viscous-friction", "bearing-drag"}]
"""
SIM = """[simulation]
model = "drive:Drive"

[parameters.rolling_A_per_N]   # of all wheels
value = 0.004
std = 0.001

[table]
offset_A = 0.0
offset_A_std = 0.01

[camera]
height_m = 1.2

[[effects]]
name = "coulomb-friction"
shape = {}
coefficients = [0.08]
wheels = [1, 2, 3, 4, 5, 6]
relative_std = 0.1
"""


def drive() -> dict[str, NDArray[np.float64]]:
    """Return a drive of a minute, six wheels, with Coulomb friction and a wheel that drags later."""
    rng = np.random.default_rng(3)
    time_s = STEP_S * np.arange(INSTANTS)
    speed = np.repeat(20 * np.sign(np.sin(time_s / 3)) * (1 + 0.5 * np.sin(time_s / 7)), 6)
    wheel = np.tile(np.arange(1.0, 7.0), INSTANTS)
    load = 49 + rng.normal(0, 3, 6 * INSTANTS)
    later = (wheel == 3) & (np.repeat(time_s, 6) > 15)
    current = 0.004 * load + 0.08 * np.sign(speed) * (1 + later) + rng.normal(0, 0.02, 6 * INSTANTS)
    return {
        "t_s": np.repeat(time_s, 6),
        "wheel": wheel,
        "motor_current_A": current,
        "motor_speed_rad_s": speed,
        "load_N": load,
    }


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the class, its SIM.toml and a whole recording of each kind."""
    folder = tmp_path_factory.mktemp("drive")
    (folder / "drive.py").write_text(MODULE)
    (folder / "SIM.toml").write_text(SIM)
    table = pa.table({name: np.round(values, 6) for name, values in drive().items()})
    pyarrow.csv.write_csv(table, folder / "whole.csv", pyarrow.csv.WriteOptions(quoting_style="none"))
    pyarrow.parquet.write_table(table, folder / "whole.parquet")
    _write_mcap(folder / "whole.mcap", None)
    load_simulation(folder / "SIM.toml")
    return folder


def _write_mcap(path: Path, random: Random | None) -> None:
    """Write the drive as the daemon does; with `random` some of its messages are changed."""
    recording = McapFile(path.open("wb"), {})
    values = np.full((INSTANTS, len(ROW), 6), np.nan)
    for quantity, row in ROW.items():
        if (column := drive().get(quantity.name)) is not None:
            values[:, row] = column.reshape(INSTANTS, 6)
    share = random.choice((0.005, 0.1, 1.0)) if random else 0.0
    for k in range(INSTANTS):
        time_ns = 10**18 + round(1e9 * STEP_S * k)
        content = snapshot_json(Snapshot(k, time_ns, values[k]))
        if random and random.random() < share:
            content = damaged_json(content, random)
        recording.write(SNAPSHOT, time_ns, content)
    recording.close()


def _write_damaged(whole: Path, path: Path, random: Random) -> None:
    """Write a damaged copy of a file: half of those but CSV are well-formed, and hold something else."""
    if path.suffix == ".toml" and random.random() < 0.5:
        path.write_text(damaged_value(whole.read_text(), random))
    elif path.suffix in {".csv", ".toml"}:
        path.write_bytes(damaged_text(whole.read_text(), random, "," if path.suffix == ".csv" else " "))
    elif random.random() < 0.5:
        path.write_bytes(damaged_bytes(whole.read_bytes(), random))
    elif path.suffix == ".parquet":
        pyarrow.parquet.write_table(damaged_table(pyarrow.parquet.read_table(whole), random), path)
    else:
        _write_mcap(path, random)


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("kind", ["csv", "parquet", "mcap", "toml"])
def test_a_changed_file_has_an_answer_or_one_message(files: Path, kind: str, tmp_path: Path) -> None:
    """The command ends with 0 and an answer, a report and a corrected file, or with 65 and one message."""
    shutil.copy(files / "drive.py", tmp_path)
    whole = files / ("SIM.toml" if kind == "toml" else f"whole.{kind}")
    path = tmp_path / f"changed.{kind}"
    answers = 0
    for seed in range(MUTATIONS):
        _write_damaged(whole, path, Random(f"{kind} {seed}"))
        recording, simulation = (files / "whole.csv", path) if kind == "toml" else (path, files / "SIM.toml")
        answers += _answered(recording, simulation, tmp_path, f"{kind} {seed}")
    assert 0 < answers < MUTATIONS  # neither is everything refused, nor is nothing


def _answered(recording: Path, simulation: Path, folder: Path, seed: str) -> bool:
    """Run the command; return whether it answered, and fail where it does neither that nor tell one message."""
    outputs = {name: folder / f"out.{name}" for name in ("json", "html", "toml")}
    options = ["--json", outputs["json"], "--report", outputs["html"], "--corrected", outputs["toml"]]
    for output in outputs.values():
        output.unlink(missing_ok=True)
    done = CliRunner().invoke(app, ["mismatch", str(recording), "--simulation", str(simulation), *map(str, options)])
    if done.exit_code == 65:
        told = done.stderr.splitlines()
        if told[0].startswith("running the code of "):  # a warning before SIM.toml's own code runs
            told = told[1:]
        assert told[0].startswith("regolithd mismatch: "), (seed, done.stderr)
        assert done.stderr.count("regolithd mismatch:") == 1, (seed, done.stderr)
        assert not any(output.exists() for output in outputs.values()), seed
        return False
    if done.exception:
        raise AssertionError(f"{seed} raised {type(done.exception).__name__}: {done.exception}") from done.exception
    assert done.exit_code == 0, seed
    assert not list(SCHEMA.iter_errors(json.loads(outputs["json"].read_text()))), seed
    assert outputs["html"].read_text().endswith("</html>\n"), seed
    load_simulation(outputs["toml"])
    return True
