"""The installed daemon where systemd is process 1, with the virtual rover on vcan0 and Debian's own mosquitto.

One installation serves all tests, as one machine would; each begins with a daemon freshly started.
"""

from __future__ import annotations

import asyncio
import json
import os
import re
import shutil
import signal
import struct
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import aiomqtt
import can
import pytest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

pytestmark = [pytest.mark.systemd, pytest.mark.timeout(300)]
ROOT = Path(__file__).resolve().parents[2]
RMEM_MAX = Path("/proc/sys/net/core/rmem_max")
RECEIVE_BUFFER_BYTES = 4 << 20
CONFIGURATION = Path("/etc/regolithd/rover.toml")
REGOLITHD = "/usr/local/bin/regolithd"
PASSWORD = "a secret"
WAIT_s = 60
MOTORS = range(1, 7)
HEARTBEAT_LOST = struct.pack("<H", 0x8130)  # the code in an EMCY message, CiA 301


def run(*command: str | Path, check: bool = True, text: str | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command; if it fails where it must not, show what it said."""
    done = subprocess.run(command, cwd=ROOT, check=False, capture_output=True, text=True, input=text)
    if check and done.returncode:
        pytest.fail(f"{command} ended with {done.returncode}:\n{done.stdout}{done.stderr}\n{journal()}", pytrace=False)
    return done


def journal(unit: str = "regolithd") -> str:
    """Return the end of what a unit has said."""
    command = ["journalctl", "--no-pager", "--output=short-monotonic", "--lines=60", "--unit", unit]
    return subprocess.run(command, check=False, capture_output=True, text=True).stdout


def shown(*properties: str) -> dict[str, str]:
    """Return properties of the daemon's unit."""
    listed = run("systemctl", "show", "regolithd", "--property", ",".join(properties)).stdout
    return dict(line.split("=", 1) for line in listed.splitlines())


def until(happened: Callable[[], bool], what: str, seconds: float = WAIT_s) -> None:
    """Wait for something to happen."""
    deadline = time.monotonic() + seconds
    while not happened():
        if time.monotonic() > deadline:
            pytest.fail(f"not within {seconds} s: {what}\n{journal()}\n{journal('virtual-rover')}", pytrace=False)
        time.sleep(0.1)


def set_line(key: str, value: str) -> None:
    """Change one line of the configuration, commented out or not."""
    text, changes = re.subn(rf"(?m)^#? ?{key} = .*$", f"{key} = {value}", CONFIGURATION.read_text())
    assert changes == 1, key
    CONFIGURATION.write_text(text)


@pytest.fixture(scope="module", autouse=True)
def _machine() -> Iterator[None]:
    """A machine set up by docs/how-to/install.md: broker, daemon, and a virtual rover where the real one would be."""
    run("systemd/install")
    for name, folder in (("conf", "/etc/mosquitto/conf.d"), ("acl", "/etc/mosquitto")):
        shutil.copy(ROOT / f"systemd/mosquitto/regolith.{name}", folder)
    passwords = Path("/etc/mosquitto/regolith.passwd")
    run("mosquitto_passwd", "-c", "-b", passwords, "regolithd", PASSWORD)
    run("mosquitto_passwd", "-b", passwords, "operator", PASSWORD)
    for path in (passwords, Path("/etc/mosquitto/regolith.acl")):
        shutil.chown(path, "mosquitto")
    run("install", "-m", "640", "-g", "regolithd", "/dev/stdin", "/etc/regolithd/mqtt-password", text=PASSWORD)
    set_line("channel", '"vcan0"')
    set_line("username", '"regolithd"')
    set_line("password_file", '"/etc/regolithd/mqtt-password"')
    done = run("systemctl", "restart", "mosquitto", check=False)
    assert done.returncode == 0, journal("mosquitto") + Path("/var/log/mosquitto/mosquitto.log").read_text()
    rover = ("--unit=virtual-rover", "--service-type=exec", REGOLITHD, "bench", "--channel", "vcan0")
    run("systemd-run", "--quiet", *rover)
    yield
    run("systemctl", "stop", "regolithd", "virtual-rover", "mosquitto", check=False)


@pytest.fixture
def pid() -> int:
    """The process number of a daemon that has just said READY."""
    run("systemctl", "stop", "regolithd")
    run("systemctl", "reset-failed", "regolithd", check=False)
    run("systemctl", "start", "regolithd")
    return int(shown("MainPID")["MainPID"])


@dataclass(frozen=True)
class Drives:
    """What the six motor controllers say of themselves."""

    statuswords: tuple[int, ...]
    speeds_rpm: tuple[int, ...]

    @property
    def enabled(self) -> bool:
        """Whether any is in `operation enabled` (CiA 402)."""
        return any(word & 0x6F == 0x27 for word in self.statuswords)


def heard_drives() -> Drives:
    """Listen for the next TPDO1 of each: statusword U16, current I16, velocity I32."""
    said: dict[int, tuple[int, int]] = {}
    deadline = time.monotonic() + WAIT_s
    with can.Bus("vcan0", interface="socketcan") as bus:
        while len(said) < len(MOTORS):
            assert time.monotonic() < deadline, f"only {sorted(said)} are heard\n{journal()}"
            message = bus.recv(1)
            if message and message.arbitration_id - 0x180 in MOTORS:
                word, _, speed = struct.unpack("<Hhi", message.data)
                said[message.arbitration_id - 0x180] = (word, speed)
    return Drives(*zip(*said.values(), strict=True))


def asked_drives() -> Drives:
    """Read statusword and velocity by SDO (CiA 301, expedited upload): without a daemon nothing is sent unasked."""
    with can.Bus("vcan0", interface="socketcan") as bus:
        words = tuple(asked(bus, node, 0x6041, "<H") for node in MOTORS)
        return Drives(words, tuple(asked(bus, node, 0x606C, "<i") for node in MOTORS))


def asked(bus: can.BusABC, node: int, index: int, layout: str) -> int:
    """Read one object of one node."""
    request = struct.pack("<BHB4x", 0x40, index, 0)
    deadline = time.monotonic() + WAIT_s
    bus.send(can.Message(arbitration_id=0x600 + node, data=request, is_extended_id=False))
    while time.monotonic() < deadline:
        message = bus.recv(1)
        if message and message.arbitration_id == 0x580 + node and message.data[1:4] == request[1:4]:
            return int(struct.unpack_from(layout, message.data, 4)[0])
    raise AssertionError(f"node {node} does not answer\n{journal('virtual-rover')}")


@pytest.fixture
def traverse(pid: int) -> Iterator[subprocess.Popen[str]]:
    """A traverse under way, far from its end."""
    assert pid
    until(lambda: run(REGOLITHD, "status", check=False).returncode == 0, "every node is operational")
    drive = [REGOLITHD, "traverse", "--distance", "10", "--speed", "0.022"]
    with subprocess.Popen(drive, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        try:
            until(lambda: process.poll() is not None or all(heard_drives().speeds_rpm), "all wheels turn")
            if process.poll() is not None:
                said = process.stdout.read() if process.stdout else ""
                pytest.fail(f"traverse ended at once ({process.returncode}):\n{said}\n{journal()}", pytrace=False)
            yield process
        finally:
            process.kill()


async def snapshot() -> dict[str, object]:
    """Return the next complete snapshot that an operator hears from the daemon."""
    async with (
        asyncio.timeout(WAIT_s),
        aiomqtt.Client("localhost", username="operator", password=PASSWORD) as client,
    ):
        await client.subscribe("regolith/kapvik/snapshot")
        async for message in client.messages:
            said = json.loads(bytes(message.payload))
            if all(said["measured"]):
                return dict(said)
    raise AssertionError("the broker ended the connection")


def test_the_units_are_right() -> None:
    """Once everything is installed, systemd finds nothing to say about the units."""
    done = run("systemd-analyze", "verify", "regolithd.service", "regolithd-can@can0.service")
    assert done.stdout + done.stderr == ""


def test_the_receive_buffer_may_be_as_large_as_the_daemon_asks_for() -> None:
    """At once, and after the next boot."""
    assert int(RMEM_MAX.read_text()) >= RECEIVE_BUFFER_BYTES
    RMEM_MAX.write_text("212992")  # as the kernel boots
    run("/lib/systemd/systemd-sysctl")
    assert int(RMEM_MAX.read_text()) >= RECEIVE_BUFFER_BYTES


async def test_it_is_ready_and_acquires_under_the_hardening(pid: int) -> None:
    """`systemctl start` returns with a daemon, not root, that hears all six wheels over CAN and says so over MQTT."""
    assert shown("ActiveState", "SubState") == {"ActiveState": "active", "SubState": "running"}
    assert run("ps", "-o", "user=", "-p", str(pid)).stdout.strip() == "regolithd"
    said = await snapshot()
    assert all(load is not None for load in said["load_N"])  # type: ignore[attr-defined]


def test_the_running_service_exposes_little(pid: int) -> None:
    """The loaded unit's exposure is 2.0 or less, and the kernel agrees that it can gain nothing."""
    assert pid
    listed = run("systemd-analyze", "security", "regolithd.service", "--no-pager").stdout
    exposure = re.search(r"Overall exposure level for \S+: ([\d.]+)", listed)
    assert exposure
    assert float(exposure[1]) <= 2.0
    status = Path(f"/proc/{pid}/status").read_text()
    assert re.search(r"NoNewPrivs:\s*1", status)
    assert re.search(r"CapBnd:\s*0+\n", status)
    assert re.search(r"Seccomp:\s*2", status)


def test_only_its_group_may_command_it(pid: int) -> None:
    """The control socket and the configuration are closed to everybody outside the group."""
    assert pid
    for path in (Path("/run/regolithd/control.sock"), CONFIGURATION):
        assert path.group() == "regolithd"
        assert path.stat().st_mode & 0o007 == 0
    refused = run("setpriv", "--reuid=nobody", "--clear-groups", REGOLITHD, "traverse", "--distance", "1", check=False)
    assert refused.returncode
    assert not heard_drives().enabled


def test_a_hung_daemon_is_killed_and_started_again(pid: int) -> None:
    """A daemon that does not answer gets SIGABRT from the watchdog, and another takes its place."""
    os.kill(pid, signal.SIGSTOP)
    until(lambda: shown("NRestarts")["NRestarts"] != "0", "the watchdog bites")
    until(lambda: shown("ActiveState")["ActiveState"] == "active", "it is ready again")
    assert shown("MainPID")["MainPID"] not in {"0", str(pid)}
    said = journal()
    assert "Watchdog timeout" in said
    assert "status=6/ABRT" in said


def test_a_clean_stop_stops_the_drives(traverse: subprocess.Popen[str]) -> None:
    """When `systemctl stop` returns, no wheel turns and no drive is enabled; the traverse says that it failed."""
    run("systemctl", "stop", "regolithd")
    drives = asked_drives()
    assert not any(drives.speeds_rpm)
    assert not drives.enabled
    assert traverse.wait(WAIT_s) != 0
    assert shown("Result")["Result"] == "success"


def test_the_drives_stop_when_the_daemon_dies(traverse: subprocess.Popen[str]) -> None:
    """After kill -9 each drive misses the heartbeat and stops; all stand still when the daemon is back."""
    noticed: set[int] = set()
    with can.Bus("vcan0", interface="socketcan") as bus:
        run("systemctl", "kill", "--signal=KILL", "regolithd")
        deadline = time.monotonic() + WAIT_s
        while len(noticed) < len(MOTORS):
            assert time.monotonic() < deadline, f"only {noticed} noticed\n{journal('virtual-rover')}"
            message = bus.recv(1)
            if message and message.arbitration_id - 0x80 in MOTORS and message.data[:2] == HEARTBEAT_LOST:
                noticed.add(message.arbitration_id - 0x80)
    until(lambda: shown("NRestarts")["NRestarts"] != "0", "it is started again")
    until(lambda: shown("ActiveState")["ActiveState"] == "active", "it is ready again")
    asyncio.run(snapshot())
    drives = heard_drives()
    assert not any(drives.speeds_rpm)
    assert not drives.enabled
    assert traverse.wait(WAIT_s) != 0


def test_a_wrong_configuration_is_not_tried_again(pid: int) -> None:
    """A configuration that is wrong ends the service with 78 and its reason in the journal, once."""
    assert pid
    right = CONFIGURATION.read_text()
    try:
        set_line("rate_Hz", "2000")
        assert run("systemctl", "restart", "regolithd", check=False).returncode
        assert shown("ExecMainStatus", "NRestarts") == {"ExecMainStatus": "78", "NRestarts": "0"}
        assert "rate_Hz" in journal()
    finally:
        CONFIGURATION.write_text(right)


@pytest.mark.timeout(600)  # two installations
def test_an_upgrade_keeps_what_was_configured(pid: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A version that would refuse the configuration changes nothing; one that reads it replaces the running one."""
    monkeypatch.setenv("PIP_NO_COMPILE", "1")  # half the time, and not what this is about
    configured = CONFIGURATION.read_text()
    before = Path("/opt/regolithd/current").resolve()
    set_line("rate_Hz", "2000")
    refused = run("systemd/install", check=False)
    CONFIGURATION.write_text(configured)
    assert refused.returncode == 78
    assert "rate_Hz" in refused.stdout + refused.stderr
    assert Path("/opt/regolithd/current").resolve() == before
    assert int(shown("MainPID")["MainPID"]) == pid

    run("systemd/install")
    assert CONFIGURATION.read_text() == configured
    assert Path("/opt/regolithd/previous").resolve() == before
    assert Path("/opt/regolithd/current").resolve() != before
    until(lambda: shown("ActiveState")["ActiveState"] == "active", "the new version is ready")
    assert int(shown("MainPID")["MainPID"]) != pid


def test_zz_what_uninstall_leaves(pid: int) -> None:
    """Removing it ends the daemon and leaves configuration and recordings, nothing else; it can be installed again."""
    assert pid
    run("systemd/uninstall")
    assert not Path("/opt/regolithd").exists()
    assert run("systemctl", "cat", "regolithd", check=False).returncode
    assert not list(Path("/usr/local/lib").glob("*.d/*regolithd*"))
    assert CONFIGURATION.exists()
    assert any(Path("/var/lib/regolithd/recordings").iterdir())
