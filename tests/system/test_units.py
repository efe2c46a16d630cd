"""The systemd units and the broker's example configuration, without a guest."""

from __future__ import annotations

import asyncio
import re
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import aiomqtt
import pytest
from broker import Mosquitto, mosquitto_program

from regolithd.daemon.config.configuration import Recording
from regolithd.daemon.control.traversed import NAME
from regolithd.drivers.can import socketcan

if TYPE_CHECKING:
    from collections.abc import Iterator

SYSTEMD = Path(__file__).resolve().parents[2] / "systemd"
EXPOSURE = re.compile(r"Overall exposure level for \S+: ([\d.]+)")


@pytest.mark.parametrize(
    ("unit", "highest"),
    [("regolithd.service", 2.0), ("regolithd-can@.service", 3.0), ("regolithd-compare.service", 2.0)],
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


@pytest.fixture
def guarded(tmp_path: Path) -> Iterator[Mosquitto]:
    """A broker with the example's access rules, and accounts of the daemon and an operator."""
    passwords = tmp_path / "passwords"
    accounts = tmp_path / "regolith.acl"
    accounts.write_text((SYSTEMD / "mosquitto/regolith.acl").read_text())
    accounts.chmod(0o600)
    if mosquitto_program() is None or shutil.which("mosquitto_passwd") is None:
        pytest.skip("no broker here: apt-get install mosquitto")
    for flag, name in (("-c", "regolithd"), (None, "operator")):
        options = [flag] if flag else []
        subprocess.run(["mosquitto_passwd", *options, "-b", passwords, name, "secret"], check=True, capture_output=True)
    ours = {"listener", "persistence", "persistence_location"}  # the fixture has its own port and folder
    lines = (SYSTEMD / "mosquitto/regolith.conf").read_text().splitlines(keepends=True)
    settings = "".join(line for line in lines if not line.strip() or line.split()[0] not in ours)
    for name, path in (("passwd", passwords), ("acl", accounts)):
        settings = settings.replace(f"/etc/mosquitto/regolith.{name}", str(path))
    broker = Mosquitto(tmp_path, settings=settings)
    broker.start()
    yield broker
    broker.stop()


async def test_only_the_daemon_publishes(guarded: Mosquitto) -> None:
    """With the example configuration an operator receives the daemon's messages and cannot publish."""
    account = {"hostname": guarded.host, "port": guarded.port, "password": "secret"}
    async with (
        aiomqtt.Client(username="operator", **account) as operator,
        aiomqtt.Client(username="regolithd", **account) as daemon,
    ):
        await operator.subscribe("regolith/#")
        await operator.publish("regolith/kapvik/state", "a lie", qos=1)
        await daemon.publish("regolith/kapvik/state", "the truth", qos=1)
        async with asyncio.timeout(30):
            first = await anext(aiter(operator.messages))
        assert first.payload == b"the truth"


async def test_anonymous_clients_are_refused(guarded: Mosquitto) -> None:
    """With the example configuration a client without a password is refused."""
    with pytest.raises(aiomqtt.MqttError):
        async with aiomqtt.Client(guarded.host, guarded.port):
            pass


def test_the_kernel_limit_is_the_receive_buffer_of_the_driver() -> None:
    """The installed sysctl limit equals the driver's receive buffer, and both scripts handle its file."""
    limit = re.search(r"(?m)^-net\.core\.rmem_max = (\d+)$", (SYSTEMD / "sysctl.conf").read_text())
    assert limit
    assert int(limit[1]) == socketcan._RECEIVE_BUFFER_BYTES
    for script in ("install", "uninstall"):
        assert "/usr/local/lib/sysctl.d/10-regolithd.conf" in (SYSTEMD / script).read_text()
