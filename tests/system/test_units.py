"""The systemd units, without a guest."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from regolithd.daemon.config.configuration import Recording
from regolithd.daemon.control.traversed import NAME
from regolithd.drivers.can import socketcan

SYSTEMD = Path(__file__).resolve().parents[2] / "systemd"
EXPOSURE = re.compile(r"Overall exposure level for \S+: ([\d.]+)")


@pytest.mark.parametrize(
    ("unit", "highest"),
    [("regolithd.service", 0.8), ("regolithd-can@.service", 3.0), ("regolithd-compare.service", 1.0)],
)
def test_a_unit_exposes_little(unit: str, highest: float) -> None:
    """The exposure level of `systemd-analyze security` stays below its limit."""
    if shutil.which("systemd-analyze") is None:
        pytest.skip("no systemd here: apt-get install systemd")
    command = ["systemd-analyze", "security", "--offline=true", "--no-pager", SYSTEMD / unit]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    exposure = EXPOSURE.search(done.stdout)
    assert exposure, done.stderr
    assert float(exposure[1]) <= highest


def test_the_comparison_starts_when_the_daemon_notes_the_end_of_a_traverse() -> None:
    """The path unit watches the file that the daemon writes beside its recordings."""
    watched = re.search(r"^PathChanged=(.*)$", (SYSTEMD / "regolithd-compare.path").read_text(), flags=re.MULTILINE)
    assert watched
    assert Path(watched[1]) == Recording().directory / NAME


def test_the_kernel_limit_is_the_receive_buffer_of_the_driver() -> None:
    """The installed sysctl limit equals the driver's receive buffer, and both scripts handle its file."""
    limit = re.search(r"(?m)^-net\.core\.rmem_max = (\d+)$", (SYSTEMD / "sysctl.conf").read_text())
    assert limit
    assert int(limit[1]) == socketcan._RECEIVE_BUFFER_BYTES
    for script in ("install", "uninstall"):
        assert "/usr/local/lib/sysctl.d/10-regolithd.conf" in (SYSTEMD / script).read_text()
