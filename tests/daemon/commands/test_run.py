"""`regolithd run` as a process, on an in-process bus without nodes and without a broker."""

from __future__ import annotations

import signal
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGINT])
def test_the_daemon_ends_with_status_0_when_it_is_asked_to(tmp_path: Path, end: signal.Signals) -> None:
    """systemd, or a person with Ctrl-C, asks; another status would be a failure."""
    config = tmp_path / "rover.toml"
    config.write_text(
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
    line = [sys.executable, "-m", "regolithd", "run", "--config", str(config)]
    with subprocess.Popen(line, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            assert any("connection refused" in said for said in process.stderr)  # it runs
            process.send_signal(end)
            assert process.wait(60) == 0
        finally:
            process.kill()
