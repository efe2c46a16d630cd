"""`regolithd run` as a process, on an in-process bus without nodes and without a broker."""

from __future__ import annotations

import signal
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from regolithd.daemon.publish.stores import Stores

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """A rover.toml with everything in a folder of its own."""
    path = tmp_path / "rover.toml"
    path.write_text(
        f"""[bus]
interface = "virtual"
[recording]
directory = "{tmp_path / "recordings"}"
[mqtt]
port = 1
spool_directory = "{tmp_path / "spool"}"
[control]
socket = "{tmp_path / "control.sock"}"
"""
    )
    return path


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGINT])
def test_the_daemon_ends_with_status_0_when_it_is_asked_to(config: Path, end: signal.Signals) -> None:
    """systemd, or a person with Ctrl-C, asks; another status would be a failure."""
    line = [sys.executable, "-m", "regolithd", "run", "--config", str(config)]
    with subprocess.Popen(line, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            assert any("connection refused" in said for said in process.stderr)  # it runs
            process.send_signal(end)
            assert process.wait(60) == 0
        finally:
            process.kill()


def test_a_second_daemon_is_refused_and_leaves_no_file(config: Path) -> None:
    """An empty recording would be the newest, which `monitor --follow` and `export` take."""
    folder = config.parent
    stores = Stores.open(folder / "spool", 10_000_000)
    before = set(folder.rglob("*"))
    line = [sys.executable, "-m", "regolithd", "run", "--config", str(config)]
    done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=60)
    stores.close()
    assert done.returncode == 1
    assert done.stderr == f"{folder}/spool: another regolithd uses it. Stop that process first.\n"
    assert set(folder.rglob("*")) == before
