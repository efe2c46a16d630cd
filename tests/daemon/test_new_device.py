"""A new kind of device needs one new file and its entry in the registry."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
NEW_DEVICE = Path(__file__).parent / "new_device"


@pytest.fixture(scope="module")
def findings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Add a thermometer to a copy of the drivers, run the daemon with it, and return what it did."""
    source = tmp_path_factory.mktemp("source")
    package = source / "regolithd"
    package.mkdir()
    (package / "__init__.py").touch()
    for room in ("daemon", "calibration"):
        (package / room).symlink_to(ROOT / room)
    devices = Path(shutil.copytree(ROOT / "drivers", package / "drivers")) / "devices"
    shutil.copy(NEW_DEVICE / "thermometer.py", devices)
    registry = devices / "registry.py"
    entry, last = "    THERMOMETER,\n", "    GROUND_SPEED_SENSOR,\n"
    imported = "from regolithd.drivers.devices.thermometer import THERMOMETER\n"
    text = (
        registry.read_text().replace(last, last + entry).replace("\nif TYPE_CHECKING", f"{imported}\nif TYPE_CHECKING")
    )
    registry.write_text(text)
    done = subprocess.run(
        [sys.executable, NEW_DEVICE / "drive.py", tmp_path_factory.mktemp("recording")],
        env=os.environ | {"PYTHONPATH": str(source)},
        check=False,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_it_boots_against_its_virtual_device(findings: dict[str, Any]) -> None:
    """The virtual rover has the node, and the master brings it to operational."""
    assert findings["nodes"][-1] == 31
    assert findings["phases"]["31"] == "operational"
    assert len(findings["phases"]) == 15


def test_its_measurement_is_published(findings: dict[str, Any]) -> None:
    """The `snapshot` message has its field, beside those of the other devices."""
    assert findings["message"]["ambient_temperature_degC"] == pytest.approx(-7.25)
    assert findings["message"]["load_N"] == [50.0, 51.0, 52.0, 53.0, 54.0, 55.0]


def test_its_measurement_is_recorded_and_exported(findings: dict[str, Any]) -> None:
    """The last column of an exported recording is its quantity."""
    assert float(findings["row"]["ambient_temperature_degC"]) == pytest.approx(-7.25)
    assert list(findings["row"])[-1] == "ambient_temperature_degC"


def test_the_documents_describe_it(findings: dict[str, Any]) -> None:
    """The bus document and the message schemas name its objects, its quantity and its kind."""
    document = findings["bus_document"]
    assert "| thermometer 31 | TPDO 1 | 0x180 + *id* | 0–3 | 0x9130:01 |" in document
    assert "### thermometer" in document
    schema = json.loads(findings["schemas"]["snapshot.schema.json"])
    assert schema["properties"]["ambient_temperature_degC"]["description"] == "In the shade of the body."
    node = json.loads(findings["schemas"]["node.schema.json"])
    assert "thermometer" in node["$defs"]["NodeKind"]["enum"]
