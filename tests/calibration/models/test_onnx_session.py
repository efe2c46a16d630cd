"""What opening an ONNX model does beside it: nothing."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

IMPORT = """
import regolithd.calibration.models.onnx_session, os
print(os.environ.get("ORT_DISABLE_TELEMETRY"))
print(*[line for line in open("/proc/self/maps") if "onnxruntime.db" in line])
"""


def imported(home: Path, **more: str) -> list[str]:
    """Return what a program prints that imports onnxruntime by way of the project; `home` is its user's folder."""
    unset = {"ORT_DISABLE_TELEMETRY", "CI", "XDG_CACHE_HOME"}  # onnxruntime is silent where CI is set
    environment = {name: value for name, value in os.environ.items() if name not in unset} | {"HOME": str(home)} | more
    done = subprocess.run(
        [sys.executable, "-c", IMPORT], check=True, capture_output=True, text=True, env=environment, timeout=60
    )
    return done.stdout.split("\n")


def test_onnxruntime_reports_to_nobody(tmp_path: Path) -> None:
    """It keeps no database of reports, in the user's folder or anywhere, unless the user has asked for it."""
    setting, database, _ = imported(tmp_path)
    assert setting == "1"
    assert database == ""
    assert not list(tmp_path.rglob("*onnxruntime*"))
    assert imported(tmp_path, ORT_DISABLE_TELEMETRY="0")[0] == "0"
