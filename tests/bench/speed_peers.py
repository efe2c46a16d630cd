"""The measurements of `speed` without the daemon: beside python-can with canopen, candump, mosquitto's persistence."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Self
from unittest.mock import patch

import speed_queue
from can_pair import pair
from speed_queue import EVERY_CHANGE, MESSAGES, REMEDY
from speed_table import Row

from regolithd.drivers import benchmark
from regolithd.drivers.can import socketcan
from regolithd.drivers.can.recvmmsg import CAN_FRAME

if TYPE_CHECKING:
    import socket
    from collections.abc import Iterator

    from speed_queue import Stored

ROUNDS = 9
BENCH = Path(__file__).resolve().parent
VCAN_HERE = Path("/sys/module/vcan")
"""There once `with-vcan` has made links on this kernel."""


def frames_on_bus() -> list[bytes]:
    """Return frames as other devices on the bus may send them: TPDO 1 to 4 of nodes that nobody expects."""
    cob_ids = [base + node for node in range(40, 104) for base in (0x180, 0x280, 0x380, 0x480)]
    return [CAN_FRAME.pack(cob_id, 8, bytes(range(8))) for cob_id in cob_ids]


class Sender:
    """Takes the place of the sending CAN socket in the benchmark of the readers: the other end of the pair."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end

    def __call__(self, *_: object) -> Sender:
        """Return itself, as `socket.socket(…)` does a socket."""
        return self

    def __enter__(self) -> Self:
        """Begin to use it."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the pair open."""

    def bind(self, address: object) -> None:
        """Do nothing: a pair has no address."""

    def send(self, frame: bytes) -> int:
        """Send a frame."""
        return self._end.send(frame)


@contextmanager
def on_pair() -> Iterator[None]:
    """Let both readers of the benchmark, and its sender, use a pair of sockets in place of SocketCAN."""
    reader, sender = pair()
    try:
        with (
            patch.object(socketcan, "_open_socket", lambda _: reader),
            patch("can.interfaces.socketcan.socketcan.create_socket", lambda: reader),
            patch("can.interfaces.socketcan.socketcan.bind_socket", lambda *_: None),
            patch("can.interfaces.socketcan.socketcan.log"),
            patch.object(benchmark.socket, "socket", Sender(sender)),
        ):
            yield
    finally:
        reader.close()
        sender.close()


async def frame_times() -> list[Row]:
    """Return the processor time for a frame, decoded alone, in bursts, one at a time: the least of the rounds."""
    rounds: dict[str, list[tuple[float, float]]] = {"decode": [], "burst": [], "one at a time": []}
    for _ in range(ROUNDS):
        rounds["decode"].append(benchmark.decoding_time())
        both = []
        for way in (benchmark.ours, benchmark.theirs):
            with on_pair():
                both.append(await benchmark.reading_time(way, "pair"))
        rounds["burst"].append((both[0][0], both[1][0]))
        rounds["one at a time"].append((both[0][1], both[1][1]))
    rows = []
    for name, pairs in rounds.items():
        mine, theirs = (min(each[k] for each in pairs) for k in (0, 1))
        goal = "no more than the peer" if name == "one at a time" else ""
        rows.append(Row(f"a frame, {name}: CPU, µs", mine, goal, theirs, "python-can and canopen"))
    return rows


def queue_rows(ours: Stored, theirs: Stored, peer: str) -> list[Row]:
    """Return what it costs to store and to deliver, and what SIGKILL lost, beside one setting of mosquitto."""
    of = f"stored message of 2 kB, beside {peer}"
    return [
        Row(f"{of}: CPU, µs", ours.cpu_us, "", theirs.cpu_us, peer),
        Row(f"{of}: stored per s", ours.stored_per_s, "", theirs.stored_per_s, peer),
        Row(f"{of}: delivered per s", ours.delivered_per_s, "", theirs.delivered_per_s, peer),
        Row(f"{of}: lost by SIGKILL, of {MESSAGES}", ours.lost, "0", theirs.lost, peer),
    ]


async def queues() -> list[Row]:
    """Return our store beside mosquitto's, as it is by default and as it stores most safely."""
    if not speed_queue.available():
        return [Row("stored message of 2 kB: CPU, µs", speed_queue.store_cost().cpu_us, peer=f"skipped: {REMEDY}")]
    mine = await speed_queue.ours()
    rows = []
    for peer, settings in (("mosquitto, saved every 30 min", ""), ("mosquitto, saved at each change", EVERY_CHANGE)):
        rows += queue_rows(mine, await speed_queue.mosquittos(settings), peer)
    return rows


def candump(seconds: float) -> list[Row]:
    """Return our reader beside candump, on vcan: of this kernel where it has it, otherwise of the guest."""
    name = "logging of a saturated bus"
    if shutil.which("candump") is None:
        return [Row(f"{name}: CPU per frame, µs", None, peer="skipped: candump is not here: apt-get install can-utils")]
    with tempfile.TemporaryDirectory() as folder:
        found = Path(folder) / "candump.json"
        script = [sys.executable, str(BENCH / "speed_candump.py"), f"{seconds:g}", str(found)]
        done = subprocess.run([str(BENCH / "with-vcan"), *script], check=False, capture_output=True, text=True)
        if not found.exists():
            why = (done.stderr.strip().splitlines() or ["no message"])[-1]
            return [Row(f"{name}: CPU per frame, µs", None, peer=f"skipped: candump needs vcan: {why}")]
        each = json.loads(found.read_text())
    where = "candump -l, on this kernel" if VCAN_HERE.exists() else "candump -l, in User Mode Linux"
    return [
        Row(f"{name}: frames sent per s", each["sent_per_s"], "9009"),
        Row(f"{name}: CPU per frame, µs", each["our_us"], "", each["their_us"], where),
        Row(f"{name}: frames lost, of {each['sent']}", each["we_lost"], "0", each["they_lost"], where),
    ]
