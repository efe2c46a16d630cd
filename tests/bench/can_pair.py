"""A CAN link between two processes on a kernel without SocketCAN: a pair of datagram sockets, one frame in each.

Frames have the layout of SocketCAN and kernel times, and are read by the same system calls, so the time that a reader
takes is that of a real link. What a real link adds is missing: arbitration, bit times, error frames.

    python tests/bench/can_pair.py daemon DESCRIPTOR ROVER_TOML     `regolithd run` on the inherited socket
    python tests/bench/can_pair.py rover DESCRIPTOR                 the virtual rover on the other one
"""

from __future__ import annotations

import asyncio
import importlib
import signal
import socket
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from regolithd.drivers.can import socketcan
from regolithd.drivers.can.recvmmsg import SO_TIMESTAMPNS

if TYPE_CHECKING:
    from regolithd.drivers.can.frame import Frame

BUFFER_BYTES = 4 << 20


def pair() -> tuple[socket.socket, socket.socket]:
    """Return both ends of a link, non-blocking, with kernel times."""
    ends = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    for end in ends:
        end.setblocking(False)
        end.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)
    return ends


class PairBus(socketcan.SocketCanBus):
    """A SocketCAN bus whose own frames come back when they are sent: a pair of sockets does not return them."""

    async def send(self, frame: Frame) -> None:
        """See `Bus.send`."""
        await super().send(frame)
        self.deliver([frame._replace(time_ns=time.time_ns(), sent=True)])


def use_pair(end: socket.socket) -> None:
    """Let the interface `socketcan` be this end of a pair, from now on."""
    socketcan._open_socket = lambda _: end  # type: ignore[assignment]
    socketcan.SocketCanBus = PairBus  # type: ignore[misc]


def run_daemon(path: Path) -> None:
    """Run the command `regolithd run` until SIGTERM."""
    importlib.import_module("regolithd.daemon.cli")  # as the command line does, before the command itself
    importlib.import_module("regolithd.daemon.commands.run").run(path)


async def run_rover() -> None:
    """Run the virtual rover until SIGTERM."""
    from regolithd.daemon.simulator.scenario import Scenario  # noqa: PLC0415  # the daemon does not need it
    from regolithd.daemon.simulator.virtual_rover import VirtualWorld  # noqa: PLC0415  # likewise
    from regolithd.drivers.virtual import VirtualRover  # noqa: PLC0415  # likewise

    rover = VirtualRover(VirtualWorld(Scenario()))
    bus = socketcan.SocketCanBus("pair")
    task = asyncio.create_task(rover.run(bus))
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
    await asyncio.wait([task])
    bus.close()


if __name__ == "__main__":
    use_pair(socket.socket(fileno=int(sys.argv[2])))
    if sys.argv[1] == "daemon":
        run_daemon(Path(sys.argv[3]))
    else:
        asyncio.run(run_rover())
