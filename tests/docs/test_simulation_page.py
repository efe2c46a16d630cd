"""The page about simulations of one's own lists everything that may be stated, and its code runs."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import numpy as np

from regolithd.calibration.mismatch.data.recording import TIME_UNITS_S, read_recording
from regolithd.calibration.mismatch.data.slow_channels import filled_between
from regolithd.calibration.mismatch.simulation.checked import checked
from regolithd.calibration.mismatch.simulation.checked_candidate import STATED
from regolithd.calibration.mismatch.simulation.simulation import Simulation

PAGE = (Path(__file__).resolve().parents[2] / "docs/how-to/simulation.md").read_text(encoding="utf-8")


def test_the_page_lists_every_attribute_and_method() -> None:
    """Nothing has to be looked up in the source."""
    methods = {name for name, value in vars(Simulation).items() if inspect.isroutine(value) and name[0] != "_"}
    listed = set(re.findall(r"^\| `(\w+)", PAGE, flags=re.MULTILINE))
    assert set(Simulation.__annotations__) | methods | set(STATED) | {"coefficients", "columns"} <= listed


def test_the_page_names_every_unit_of_time() -> None:
    """A column of time has its unit in its name."""
    assert all(f"`{name}`" in PAGE for name in TIME_UNITS_S)


def test_the_class_on_the_page_predicts_the_recording_on_the_page(tmp_path: Path) -> None:
    """Text names of axes and a slower sensor are read as the page says."""
    blocks = re.findall(r"```(\w+)\n(.*?)```", PAGE, flags=re.DOTALL)
    python = next(text for kind, text in blocks if kind == "python")
    table = next(text for kind, text in blocks if kind == "text" and text.startswith("t_s"))
    (tmp_path / "monday.csv").write_text(table)
    names: dict[str, type[Simulation]] = {}
    exec(python, names)
    joint = checked(names["Joint"]())
    recording = read_recording(tmp_path / "monday.csv", unit=joint.wheel_column)
    assert recording.wheels == ("elbow", "wrist")
    prepared = joint.prepare(filled_between(recording, joint.channel, joint.between_readings))
    inputs = {**prepared.channels, "t_s": np.zeros(prepared.shape)}
    np.testing.assert_allclose(joint.predict(inputs, {"inertia_kg_m2": 0.5}), [[1.55, 0.45], [1.5, np.nan]])
    assert set(joint.covariates(inputs)) == {"wheel_speed", "temperature"}
