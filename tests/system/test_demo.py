"""`regolithd demo` as a process, and what the daemon's modules import."""

import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_demo_runs_ends_and_leaves_a_recording_a_log_and_a_picture(tmp_path: Path) -> None:
    """Without a terminal the demo prints tables and file names, and its log replays to the same numbers."""
    command = [sys.executable, "-m", "regolithd", "demo", "--seconds", "12", "--out", str(tmp_path / "demo")]
    command += ["--no-compare", "--paper"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=100)
    assert done.returncode == 0, done.stderr
    assert "regolith/kapvik online" in done.stdout
    (mcap,) = (tmp_path / "demo").glob("*.mcap")
    (log,) = (tmp_path / "demo").glob("*.log")
    picture = tmp_path / "demo" / "drive.png"
    assert picture.read_bytes().startswith(b"\x89PNG")
    for path in (mcap, log, picture):
        assert path.name in done.stdout
    assert re.search(r"computing the drive before, without waiting: 1[45] min", done.stdout)
    assert "front axle on the weak soil from" in done.stdout

    replay = [sys.executable, "-m", "regolithd", "replay", str(log)]
    again = subprocess.run(replay, cwd=ROOT, capture_output=True, text=True, check=False, timeout=100)
    assert again.returncode == 0, again.stderr
    assert "identical  to the last bit" in again.stdout


def test_importing_the_daemon_does_not_load_what_only_the_laptop_has() -> None:
    """Service, sinks and command line import no library of the extras `demo` and `calibration`."""
    code = (
        "import sys, json, regolithd.daemon.service, regolithd.daemon.wiring, regolithd.daemon.cli;"
        "print(json.dumps([name for name in sys.modules if '.' not in name]))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = set(json.loads(done.stdout))
    assert not loaded & {"jax", "scipy", "matplotlib", "pyarrow", "onnx", "pandas", "amqtt", "numba", "optax"}
