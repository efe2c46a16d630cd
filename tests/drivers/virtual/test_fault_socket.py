"""Fault injection through the UNIX socket, in one process."""

from __future__ import annotations

import asyncio
import socket
from typing import TYPE_CHECKING

import pytest

from regolithd.drivers.virtual import Bench, VirtualRover
from regolithd.drivers.virtual.fault_socket import FaultSocketError, fault_socket, send_command

if TYPE_CHECKING:
    from pathlib import Path


async def test_a_command_is_executed_and_answered(tmp_path: Path) -> None:
    """Each command has its answer, several lines as well; the socket is this user's alone and is removed at the end."""
    path = tmp_path / "bench.sock"
    rover = VirtualRover(Bench())
    async with fault_socket(rover, path):
        assert path.stat().st_mode & 0o777 == 0o600
        assert await asyncio.to_thread(send_command, path, "silent 11") == "ok"
        assert rover.nodes[11].faults.silent
        assert (await asyncio.to_thread(send_command, path, "help")).count("\n") > 10
        assert (await asyncio.to_thread(send_command, path, "off 99")).startswith("error: there is no node 99")
    assert not path.exists()


async def test_two_rovers_do_not_share_a_socket(tmp_path: Path) -> None:
    """The second one is refused, and the first one goes on."""
    path = tmp_path / "bench.sock"
    async with fault_socket(VirtualRover(Bench()), path):
        with pytest.raises(FaultSocketError, match="a virtual rover listens there already"):
            async with fault_socket(VirtualRover(Bench()), path):
                pass
        assert await asyncio.to_thread(send_command, path, "clear all") == "ok"


async def test_the_socket_of_a_terminated_rover_is_replaced(tmp_path: Path) -> None:
    """A file that nobody listens at is removed."""
    path = tmp_path / "bench.sock"
    with socket.socket(socket.AF_UNIX) as stale:
        stale.bind(str(path))
    async with fault_socket(VirtualRover(Bench()), path):
        assert await asyncio.to_thread(send_command, path, "clear all") == "ok"


async def test_a_socket_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    """The message has the path and the system's reason."""
    with pytest.raises(FaultSocketError, match=r"nowhere/bench\.sock: No such file"):
        async with fault_socket(VirtualRover(Bench()), tmp_path / "nowhere" / "bench.sock"):
            pass


def test_a_command_without_a_rover_says_how_to_start_one(tmp_path: Path) -> None:
    """No socket, and a rover that closes the connection or does not answer."""
    with pytest.raises(FaultSocketError, match=r"Is `regolithd bench` running, with this --control\?"):
        send_command(tmp_path / "bench.sock", "help")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(tmp_path / "hangs.sock"))
        listening.listen()
        with pytest.raises(FaultSocketError, match="timed out"):
            send_command(tmp_path / "hangs.sock", "help", timeout_s=0.05)
