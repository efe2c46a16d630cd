"""A traverse of the virtual rover with a concealed drag, computed without waiting and recorded as the daemon does."""

from __future__ import annotations

import grp
import os
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from regolithd.calibration.parameters import Drivetrain
from regolithd.daemon.closed_loop.simulated_drive import START_NS, record, simulate
from regolithd.daemon.closed_loop.speed_profile import shuttle
from regolithd.daemon.config.reader import read_configuration
from regolithd.daemon.control.traversed import Traversed
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.simulator.scenario import Hidden, Scenario

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.daemon.config.configuration import Configuration

SECOND = 1_000_000_000
HOUR_NS = 3600 * SECOND
NO_LOAD_A = 0.037
ROVER = f"""
[nodes]
inclinometer = 21
ground_speed = 22
[drivetrain]
no_load_current_A = {NO_LOAD_A}
no_load_current_std_A = 0.001
gain_relative_std = 0.03
[posterior]
soil = "sandy-loam"
[bus]
interface = "virtual"
[recording]
directory = "recordings"
[control]
socket = "control.sock"
group = "{grp.getgrgid(os.getgid()).gr_name}"
[mqtt]
host = "127.0.0.1"
port = {{port}}
spool_directory = "spool"
"""
PROCESS_TIMEOUT_s = 30


def drive_traverse(
    folder: Path, port: int, duration_s: float, viscous: float, seed: int = 3, start_ns: int = START_NS
) -> Configuration:
    """Record a drive whose part without the first and last ten seconds is the traverse; return its configuration.

    `rover.toml`, in `folder`, knows nothing of the drag, `viscous` [A s/rad]; `port` is the broker's.
    """
    (folder / "rover.toml").write_text(ROVER.format(port=port))
    configuration = read_configuration(folder / "rover.toml")
    drivetrain = Drivetrain(no_load_current_A=(NO_LOAD_A,) * 6, viscous_current_A_s_per_rad=(viscous,) * 6)
    scenario = Scenario(hidden=Hidden(grade_resistance=0.0), drivetrain=drivetrain)
    drive = simulate(scenario, configuration, shuttle(seed, duration_s, configuration.sync.rate_Hz), start_ns)
    recordings = configuration.recording.directory
    recordings.mkdir(exist_ok=True)
    record(drive, configuration, load_models(configuration).terrain, recordings)
    to_ns = start_ns + int((duration_s - 10) * SECOND)
    Traversed(from_ns=start_ns + 10 * SECOND, to_ns=to_ns, ending="finished").write(recordings)
    return configuration


@contextmanager
def daemon(folder: Path) -> Iterator[None]:
    """Run the daemon of this folder's `rover.toml`, without nodes, while the context lasts."""
    program = Path(__file__).with_name("daemon_without_nodes.py")
    with subprocess.Popen([sys.executable, program, folder / "rover.toml"]) as process:
        deadline = time.monotonic() + PROCESS_TIMEOUT_s
        try:
            while not (folder / "control.sock").exists():
                assert process.poll() is None
                assert time.monotonic() < deadline
                time.sleep(0.1)
            yield
        finally:
            process.terminate()
