"""`regolithd-can@.service` on a real can-dev link: slcan over a pty, with an emulated LAWICEL adapter."""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import struct
import subprocess
import termios
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.systemd
UNIT = Path(__file__).resolve().parents[2] / "systemd/regolithd-can@.service"
N_SLCAN = 17  # the line discipline's number, linux/tty.h
LINKS = Path("/sys/class/net")


class Adapter:
    """A LAWICEL adapter on a pty: answers every command with a carriage return, and keeps all commands."""

    def __init__(self) -> None:
        self.commands: list[str] = []
        self.ours, self.kernels = os.openpty()
        attributes = termios.tcgetattr(self.kernels)
        attributes[3] &= ~(termios.ECHO | termios.ICANON)
        termios.tcsetattr(self.kernels, termios.TCSANOW, attributes)
        before = set(LINKS.iterdir())
        fcntl.ioctl(self.kernels, termios.TIOCSETD, struct.pack("i", N_SLCAN))
        (link,) = set(LINKS.iterdir()) - before
        self.link = link.name  # slcan0 or can0: kernels differ
        self.thread = threading.Thread(target=self.answer)
        self.thread.start()

    def answer(self) -> None:
        """Answer until the kernel closes its side."""
        while True:
            try:
                received = os.read(self.ours, 64)
            except OSError:
                return
            self.commands += received.decode("ascii").split("\r")[:-1]
            os.write(self.ours, b"\r" * received.count(b"\r"))

    def close(self) -> None:
        """Close the adapter, which removes the link."""
        os.close(self.kernels)
        self.thread.join()
        os.close(self.ours)


@pytest.fixture
def adapter() -> Iterator[Adapter]:
    """An adapter whose link exists and is down."""
    plugged = Adapter()
    try:
        yield plugged
    finally:
        subprocess.run(["systemctl", "stop", f"regolithd-can@{plugged.link}"], check=False, capture_output=True)
        plugged.close()


def run(*command: str) -> str:
    """Run a command that must succeed; return its output."""
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, f"{done.stdout}{done.stderr}\n{command}"
    return done.stdout


def start(unit: str) -> None:
    """Start the unit and wait until it is active; on a busy machine the first attempt may time out."""
    subprocess.run(["systemctl", "start", unit], check=False, capture_output=True)
    deadline = time.monotonic() + 90
    while subprocess.run(["systemctl", "is-active", "--quiet", unit], check=False).returncode:
        assert time.monotonic() < deadline, run("journalctl", "--no-pager", "--unit", unit)
        time.sleep(0.2)


@pytest.fixture(scope="module")
def unit() -> Iterator[str]:
    """The unit's name with {} for the link, installed in /run."""
    place = Path("/run/systemd/system")
    shutil.copy(UNIT, place)
    run("systemctl", "daemon-reload")
    yield "regolithd-can@{}.service"
    (place / UNIT.name).unlink()
    run("systemctl", "daemon-reload")


def test_the_link_comes_up_with_bit_rate_and_queue(adapter: Adapter, unit: str) -> None:
    """Starting the unit opens the adapter at 1 Mbit/s with a queue of 1000 frames; stopping it closes the adapter."""
    unit = unit.format(adapter.link)
    start(unit)
    link = run("ip", "-details", "link", "show", adapter.link)
    assert re.search(r"<\S*\bUP\b", link)
    assert "bitrate 1000000" in link
    assert "qlen 1000" in link
    assert adapter.commands[-2:] == ["S8", "O"]  # 1 Mbit/s, open
    run("systemctl", "stop", unit)
    assert not re.search(r"<\S*\bUP\b", run("ip", "link", "show", adapter.link))
    assert adapter.commands[-1] == "C"


def test_another_bit_rate_is_one_drop_in(adapter: Adapter, unit: str) -> None:
    """`Environment=BITRATE=` in a drop-in changes the bit rate."""
    unit = unit.format(adapter.link)
    drop_in = Path(f"/run/systemd/system/{unit}.d/rate.conf")
    drop_in.parent.mkdir(parents=True)
    drop_in.write_text("[Service]\nEnvironment=BITRATE=500000\n")
    run("systemctl", "daemon-reload")
    try:
        start(unit)
        assert "bitrate 500000" in run("ip", "-details", "link", "show", adapter.link)
        assert "S6" in adapter.commands
    finally:
        run("systemctl", "stop", unit)
        shutil.rmtree(drop_in.parent)


def test_without_the_interface_nothing_fails(unit: str) -> None:
    """Where the interface does not exist the unit is skipped, so that the daemon can start and report it."""
    unit = unit.format("can9")
    run("systemctl", "start", unit)
    state = run("systemctl", "show", unit, "--property=ActiveState,ConditionResult")
    assert sorted(state.split()) == ["ActiveState=inactive", "ConditionResult=no"]
