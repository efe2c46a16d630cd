"""The installed service under systemd, with the virtual rover on vcan0 and Debian's mosquitto.

All tests use one installation; most start the daemon anew.
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
OVER_IP = Path("/usr/local/lib/systemd/system/regolithd.service.d/broker-over-ip.conf")
REGOLITHD = "/usr/local/bin/regolithd"
PASSWORD = "a secret"
TIMEOUT_s = 60
MOTORS = range(1, 7)
HEARTBEAT_LOST = struct.pack("<H", 0x8130)  # the code in an EMCY message, CiA 301


def run(*command: str | Path, check: bool = True, text: str | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command; fail with its output and the journal if it must succeed (`check`) and does not."""
    done = subprocess.run(command, cwd=ROOT, check=False, capture_output=True, text=True, input=text)
    if check and done.returncode:
        pytest.fail(f"{command} ended with {done.returncode}:\n{done.stdout}{done.stderr}\n{journal()}", pytrace=False)
    return done


def journal(unit: str = "regolithd") -> str:
    """Return the last lines of a unit's journal."""
    command = ["journalctl", "--no-pager", "--output=short-monotonic", "--lines=200", "--unit", unit]
    return subprocess.run(command, check=False, capture_output=True, text=True).stdout


def unit_properties(*properties: str) -> dict[str, str]:
    """Return properties of regolithd.service."""
    listed = run("systemctl", "show", "regolithd", "--property", ",".join(properties)).stdout
    return dict(line.split("=", 1) for line in listed.splitlines())


def until(condition: Callable[[], bool], what: str, seconds: float = TIMEOUT_s) -> None:
    """Wait until a condition holds; after `seconds` fail with the journals."""
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            pytest.fail(f"not within {seconds} s: {what}\n{journal()}\n{journal('virtual-rover')}", pytrace=False)
        time.sleep(0.1)


def set_line(key: str, value: str) -> None:
    """Set a key of the configuration; where it only stands in a comment, there."""
    before = CONFIGURATION.read_text()
    stated = re.findall(rf"(?m)^{key} = .*$", before)
    text, changes = re.subn(rf"(?m)^{'' if stated else '# ?'}{key} = .*$", f"{key} = {value}", before)
    assert changes == 1, key
    CONFIGURATION.write_text(text)


def set_broker_socket(*, used: bool) -> None:
    """Let the daemon reach the broker by its Unix socket, or by host and port."""
    line, commented = 'socket = "/run/regolithd-mqtt/', '# socket = "/run/regolithd-mqtt/'
    text = CONFIGURATION.read_text().replace(commented, line)
    CONFIGURATION.write_text(text if used else text.replace(line, commented))


@pytest.fixture(scope="module", autouse=True)
def _machine() -> Iterator[None]:
    """A machine set up by docs/how-to/install.md, with broker, daemon and virtual rover."""
    run("systemd/install")
    for name, folder in (("conf", "/etc/mosquitto/conf.d"), ("acl", "/etc/mosquitto")):
        shutil.copy(ROOT / f"systemd/mosquitto/regolith.{name}", folder)
    passwords = Path("/etc/mosquitto/regolith.passwd")
    run("mosquitto_passwd", "-c", "-b", passwords, "kapvik", PASSWORD)
    run("mosquitto_passwd", "-b", passwords, "operator", PASSWORD)
    for path in (passwords, Path("/etc/mosquitto/regolith.acl")):
        shutil.chown(path, "mosquitto")
    run("install", "-m", "640", "-g", "regolithd", "/dev/stdin", "/etc/regolithd/mqtt-password", text=PASSWORD)
    tmpfiles = Path("/etc/tmpfiles.d/regolithd-mqtt.conf")
    shutil.copy(ROOT / "systemd/mosquitto/tmpfiles.conf", tmpfiles)
    run("systemd-tmpfiles", "--create", tmpfiles)
    set_line("channel", '"vcan0"')
    set_broker_socket(used=True)
    set_line("username", '"kapvik"')
    set_line("password_file", '"/etc/regolithd/mqtt-password"')
    done = run("systemctl", "restart", "mosquitto", check=False)
    assert done.returncode == 0, journal("mosquitto") + Path("/var/log/mosquitto/mosquitto.log").read_text()
    rover = ("--unit=virtual-rover", "--service-type=exec", REGOLITHD, "bench", "--channel", "vcan0")
    run("systemd-run", "--quiet", *rover)
    yield
    run("systemctl", "stop", "regolithd", "virtual-rover", "mosquitto", check=False)


@pytest.fixture
def pid() -> int:
    """The process id of a daemon that has just become ready."""
    run("systemctl", "stop", "regolithd")
    run("systemctl", "reset-failed", "regolithd", check=False)
    run("systemctl", "start", "regolithd")
    return int(unit_properties("MainPID")["MainPID"])


@dataclass(frozen=True)
class Drives:
    """Statuswords and speeds of the six motor controllers."""

    statuswords: tuple[int, ...]
    speeds_rpm: tuple[int, ...]

    @property
    def enabled(self) -> bool:
        """Whether any is in state operation enabled (CiA 402)."""
        return any(word & 0x6F == 0x27 for word in self.statuswords)


def drives_by_pdo() -> Drives:
    """Receive the next TPDO 1 of each: statusword U16, current I16, velocity I32."""
    received: dict[int, tuple[int, int]] = {}
    deadline = time.monotonic() + TIMEOUT_s
    with can.Bus("vcan0", interface="socketcan") as bus:
        while len(received) < len(MOTORS):
            assert time.monotonic() < deadline, f"only {sorted(received)} are received\n{journal()}"
            message = bus.recv(1)
            if message and message.arbitration_id - 0x180 in MOTORS:
                word, _, speed = struct.unpack("<Hhi", message.data)
                received[message.arbitration_id - 0x180] = (word, speed)
    return Drives(*zip(*received.values(), strict=True))


def drives_by_sdo() -> Drives:
    """Read statusword and velocity by SDO (CiA 301, expedited upload): without a daemon there are no PDOs."""
    with can.Bus("vcan0", interface="socketcan") as bus:
        words = tuple(read_object(bus, node, 0x6041, "<H") for node in MOTORS)
        return Drives(words, tuple(read_object(bus, node, 0x606C, "<i") for node in MOTORS))


def read_object(bus: can.BusABC, node: int, index: int, layout: str) -> int:
    """Read one object of one node by SDO."""
    request = struct.pack("<BHB4x", 0x40, index, 0)
    deadline = time.monotonic() + TIMEOUT_s
    bus.send(can.Message(arbitration_id=0x600 + node, data=request, is_extended_id=False))
    while time.monotonic() < deadline:
        message = bus.recv(1)
        if message and message.arbitration_id == 0x580 + node and message.data[1:4] == request[1:4]:
            return int(struct.unpack_from(layout, message.data, 4)[0])
    raise AssertionError(f"node {node} does not answer\n{journal('virtual-rover')}")


@pytest.fixture
def traverse(pid: int) -> Iterator[subprocess.Popen[str]]:
    """A running traverse of 10 m, all wheels turning."""
    assert pid
    until(lambda: run(REGOLITHD, "status", check=False).returncode == 0, "every node is operational")
    drive = [REGOLITHD, "traverse", "--distance", "10", "--speed", "0.022"]
    with subprocess.Popen(drive, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        try:
            until(lambda: process.poll() is not None or all(drives_by_pdo().speeds_rpm), "all wheels turn")
            if process.poll() is not None:
                output = process.stdout.read() if process.stdout else ""
                pytest.fail(f"traverse ended at once ({process.returncode}):\n{output}\n{journal()}", pytrace=False)
            yield process
        finally:
            process.kill()


async def snapshot() -> dict[str, object]:
    """Return the next snapshot with all wheels measured, as an operator receives it."""
    async with (
        asyncio.timeout(TIMEOUT_s),
        aiomqtt.Client("localhost", username="operator", password=PASSWORD) as client,
    ):
        await client.subscribe("regolith/kapvik/snapshot")
        async for message in client.messages:
            content = json.loads(bytes(message.payload))
            if all(content["measured"]):
                return dict(content)
    raise AssertionError("the broker ended the connection")


def test_systemd_verifies_the_units() -> None:
    """`systemd-analyze verify` reports nothing about the installed units."""
    done = run("systemd-analyze", "verify", "regolithd.service", "regolithd-can@can0.service")
    assert done.stdout + done.stderr == ""


def test_the_kernel_allows_the_receive_buffer_of_the_driver() -> None:
    """The limit is large enough after the installation, and again after a boot."""
    assert int(RMEM_MAX.read_text()) >= RECEIVE_BUFFER_BYTES
    RMEM_MAX.write_text("212992")  # the kernel's default
    run("/lib/systemd/systemd-sysctl")
    assert int(RMEM_MAX.read_text()) >= RECEIVE_BUFFER_BYTES


async def test_it_is_ready_and_acquires_under_the_hardening(pid: int) -> None:
    """`systemctl start` returns with a daemon of user regolithd that publishes readings of all six wheels."""
    assert unit_properties("ActiveState", "SubState") == {"ActiveState": "active", "SubState": "running"}
    assert run("ps", "-o", "user=", "-p", str(pid)).stdout.strip() == "regolithd"
    content = await snapshot()
    assert all(load is not None for load in content["load_N"])  # type: ignore[attr-defined]


def test_the_running_service_exposes_little(pid: int) -> None:
    """The loaded unit's exposure is 1.0 or less; its process has no capabilities and a seccomp filter."""
    assert pid
    listed = run("systemd-analyze", "security", "regolithd.service", "--no-pager").stdout
    exposure = re.search(r"Overall exposure level for \S+: ([\d.]+)", listed)
    assert exposure
    assert float(exposure[1]) <= 1.0
    status = Path(f"/proc/{pid}/status").read_text()
    assert re.search(r"NoNewPrivs:\s*1", status)
    assert re.search(r"CapBnd:\s*0+\n", status)
    assert re.search(r"Seccomp:\s*2", status)


def test_only_its_group_may_command_it(pid: int) -> None:
    """Control socket and configuration are accessible only to the group, and a traverse of another user is refused."""
    assert pid
    for path in (Path("/run/regolithd/control.sock"), CONFIGURATION):
        assert path.group() == "regolithd"
        assert path.stat().st_mode & 0o007 == 0
    refused = run("setpriv", "--reuid=nobody", "--clear-groups", REGOLITHD, "traverse", "--distance", "1", check=False)
    assert refused.returncode
    assert not drives_by_pdo().enabled


def test_a_hung_daemon_is_killed_and_started_again(pid: int) -> None:
    """A suspended daemon gets SIGABRT from the watchdog and is restarted."""
    os.kill(pid, signal.SIGSTOP)
    until(lambda: unit_properties("NRestarts")["NRestarts"] != "0", "the watchdog restarts it")
    until(lambda: unit_properties("ActiveState")["ActiveState"] == "active", "it is ready again")
    assert unit_properties("MainPID")["MainPID"] not in {"0", str(pid)}
    log = journal()
    assert "Watchdog timeout" in log
    assert "status=6/ABRT" in log


def test_a_clean_stop_stops_the_drives(traverse: subprocess.Popen[str]) -> None:
    """After `systemctl stop` no wheel turns and no drive is enabled, and the traverse command fails."""
    run("systemctl", "stop", "regolithd")
    drives = drives_by_sdo()
    assert not any(drives.speeds_rpm)
    assert not drives.enabled
    assert traverse.wait(TIMEOUT_s) != 0
    assert unit_properties("Result")["Result"] == "success"


def test_the_drives_stop_when_the_daemon_dies(traverse: subprocess.Popen[str]) -> None:
    """After SIGKILL each drive misses the heartbeat and stops, and all stand still when the daemon is back."""
    missed: set[int] = set()
    with can.Bus("vcan0", interface="socketcan") as bus:
        run("systemctl", "kill", "--signal=KILL", "regolithd")
        deadline = time.monotonic() + TIMEOUT_s
        while len(missed) < len(MOTORS):
            assert time.monotonic() < deadline, f"only {missed} missed\n{journal('virtual-rover')}"
            message = bus.recv(1)
            if message and message.arbitration_id - 0x80 in MOTORS and message.data[:2] == HEARTBEAT_LOST:
                missed.add(message.arbitration_id - 0x80)
    until(lambda: unit_properties("NRestarts")["NRestarts"] != "0", "it is started again")
    until(lambda: unit_properties("ActiveState")["ActiveState"] == "active", "it is ready again")
    asyncio.run(snapshot())
    drives = drives_by_pdo()
    assert not any(drives.speeds_rpm)
    assert not drives.enabled
    assert traverse.wait(TIMEOUT_s) != 0


def test_with_an_invalid_configuration_the_service_is_not_restarted(pid: int) -> None:
    """An invalid configuration ends the service with status 78 and the key in the journal, without a restart."""
    assert pid
    valid = CONFIGURATION.read_text()
    try:
        set_line("rate_Hz", "2000")
        assert run("systemctl", "restart", "regolithd", check=False).returncode
        assert unit_properties("ExecMainStatus", "NRestarts") == {"ExecMainStatus": "78", "NRestarts": "0"}
        assert "rate_Hz" in journal()
    finally:
        CONFIGURATION.write_text(valid)


@pytest.mark.timeout(600)  # two installations
def test_an_upgrade_keeps_the_configuration(pid: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A version that refuses it is not installed; one that reads it is, and reaches a broker over IP as before."""
    monkeypatch.setenv("PIP_NO_COMPILE", "1")  # halves the time
    configured = CONFIGURATION.read_text()
    before = Path("/opt/regolithd/current").resolve()
    set_line("rate_Hz", "2000")
    refused = run("systemd/install", check=False)
    CONFIGURATION.write_text(configured)
    assert refused.returncode == 78
    assert "rate_Hz" in refused.stdout + refused.stderr
    assert Path("/opt/regolithd/current").resolve() == before
    assert int(unit_properties("MainPID")["MainPID"]) == pid

    assert not OVER_IP.exists()
    set_broker_socket(used=False)
    configured = CONFIGURATION.read_text()
    run("systemd/install")
    assert CONFIGURATION.read_text() == configured
    assert OVER_IP.exists()
    assert Path("/opt/regolithd/previous").resolve() == before
    assert Path("/opt/regolithd/current").resolve() != before
    until(lambda: unit_properties("ActiveState")["ActiveState"] == "active", "the new version is ready")
    assert int(unit_properties("MainPID")["MainPID"]) != pid
    asyncio.run(snapshot())


def test_zz_uninstalling_keeps_configuration_and_recordings(pid: int) -> None:
    """Uninstalling stops the daemon and removes everything but configuration and recordings."""
    assert pid
    run("systemd/uninstall")
    assert not Path("/opt/regolithd").exists()
    assert run("systemctl", "cat", "regolithd", check=False).returncode
    assert not OVER_IP.exists()
    assert not list(Path("/usr/local/lib").glob("*.d/*regolithd*"))
    assert CONFIGURATION.exists()
    assert any(Path("/var/lib/regolithd/recordings").iterdir())
