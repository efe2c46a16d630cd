"""What the service's sandbox refuses, tried from inside it under systemd: a probe in place of the daemon."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = [pytest.mark.systemd, pytest.mark.timeout(300)]
UNIT = Path(__file__).resolve().parents[2] / "systemd/regolithd.service"
PROBE_UNIT = Path("/run/systemd/system/regolithd-probe.service")
PROBE = r"""
import ctypes, json, mmap, os, shutil, socket, subprocess
def result(act):
    try:
        act()
    except (OSError, subprocess.SubprocessError) as error:
        return type(error).__name__
    return "allowed"
def write(path):
    with open(path, "w") as file:
        file.write("x")
def run_copy(folder):
    copy = folder + "/copied"
    shutil.copy("/bin/true", copy)
    os.chmod(copy, 0o700)
    subprocess.run([copy], check=True)
def load_copy(folder):
    copy = folder + "/copied.so"
    shutil.copy(library, copy)
    ctypes.CDLL(copy)
library = next(line.split()[-1] for line in open("/proc/self/maps") if "libc.so" in line)
STATE = "/var/lib/regolithd"
print("PROBE " + json.dumps({
    "write to its state": result(lambda: write(STATE + "/probe")),
    **{"write to " + path: result(lambda path=path: write(path)) for path in
       ("/etc/probe", "/usr/probe", "/opt/regolithd/probe", "/var/log/probe", "/etc/regolithd/rover.toml")},
    "read /etc/shadow": result(lambda: open("/etc/shadow").close()),
    **{name: result(lambda args=args: socket.socket(*args).close()) for name, args in {
        "CAN socket": (socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW),
        "Internet socket": (socket.AF_INET, socket.SOCK_STREAM),
        "packet socket": (socket.AF_PACKET, socket.SOCK_RAW),
        "netlink socket": (socket.AF_NETLINK, socket.SOCK_RAW),
        "raw socket": (socket.AF_INET, socket.SOCK_RAW, 1)}.items()},
    "writable and executable memory": result(
        lambda: mmap.mmap(-1, 4096, prot=mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC)),
    **{"run a file from " + folder: result(lambda folder=folder: run_copy(folder)) for folder in (STATE, "/tmp")},
    **{"load a library from " + folder: result(lambda folder=folder: load_copy(folder)) for folder in (STATE, "/tmp")},
    "change the clock": result(lambda: __import__("time").clock_settime(0, 0)),
}), flush=True)
"""
ALLOWED = {"write to its state", "CAN socket"}


@pytest.fixture(scope="module")
def found() -> Iterator[dict[str, str]]:
    """What the probe could do, in a copy of the unit that runs it once."""
    root = UNIT.parents[1]
    for command in (
        ["systemd-sysusers", root / "systemd/sysusers.conf"],
        ["systemd-tmpfiles", "--create", root / "systemd/tmpfiles.conf"],
    ):
        subprocess.run(command, check=False, capture_output=True)
    script = Path("/usr/local/lib/regolithd-probe.py")
    script.parent.mkdir(parents=True, exist_ok=True)
    script.write_text(PROBE)
    text = UNIT.read_text()
    for key, value in (("ExecStart", f"/usr/bin/python3 {script}"), ("Type", "oneshot"), ("Restart", "no")):
        text, count = re.subn(rf"(?m)^{key}=.*$", f"{key}={value}", text)
        assert count == 1, key
    PROBE_UNIT.parent.mkdir(parents=True, exist_ok=True)
    PROBE_UNIT.write_text(re.sub(r"(?m)^(WatchdogSec|Wants|After)=.*\n", "", text))
    subprocess.run(["systemctl", "daemon-reload"], check=True)
    done = subprocess.run(["systemctl", "start", PROBE_UNIT.name], check=False, capture_output=True, text=True)
    command = ["journalctl", "--no-pager", "--output=cat", "--unit", PROBE_UNIT.name]
    journal = subprocess.run(command, check=False, capture_output=True, text=True).stdout
    line = re.search(r"PROBE (\{.*\})", journal)
    assert line, done.stderr + journal
    yield json.loads(line[1])
    PROBE_UNIT.unlink()
    script.unlink()


def test_only_what_the_daemon_needs_is_allowed(found: dict[str, str]) -> None:
    """Writing elsewhere, other sockets, and running or loading what it has written are refused; CAN is not."""
    assert {name for name, result in found.items() if result == "allowed"} == ALLOWED, found


def test_memory_and_tasks_are_bounded(found: dict[str, str]) -> None:
    """By the unit, below what a Raspberry Pi with 1 GB has."""
    assert found
    command = ["systemctl", "show", PROBE_UNIT.name, "--property", "MemoryMax,TasksMax"]
    shown = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert dict(line.split("=", 1) for line in shown.split()) == {"MemoryMax": str(512 << 20), "TasksMax": "64"}
