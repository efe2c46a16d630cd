"""A CANopen master to test the virtual nodes: without a bus, in simulated time, independent of the driver's code.

It encodes CiA 301 messages byte by byte, so that an error common to driver and virtual node is detected.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.virtual import KAPVIK, Bench, VirtualRover

if TYPE_CHECKING:
    from collections.abc import Iterable

    from regolithd.drivers.devices.node import NodeDescription
    from regolithd.drivers.virtual import Plant
    from regolithd.drivers.virtual.node import VirtualNode

SECOND = 1_000_000_000
MASTER_ID = 127


class AbortedError(Exception):
    """The node aborted an SDO transfer with this abort code."""

    def __init__(self, code: int) -> None:
        self.code = code
        super().__init__(f"0x{code:08X}")


class Master:
    """A virtual rover in memory, with simulated clocks. `seen` keeps every frame that the rover sent."""

    def __init__(self, nodes: Iterable[NodeDescription] = KAPVIK, plant: Plant | None = None) -> None:
        self.now = 0
        self.rover = VirtualRover(
            plant or Bench(), nodes, monotonic_ns=lambda: self.now, wall_ns=lambda: 1_700_000_000 * SECOND + self.now
        )
        self.seen: list[Frame] = []
        self.rover.power_on(self.now)
        self.wait(0.1)

    def node(self, node_id: int) -> VirtualNode:
        """Return a node."""
        return self.rover.nodes[node_id]

    def wait(self, seconds: float, step_s: float = 0.005) -> list[Frame]:
        """Advance time and return the frames sent meanwhile."""
        before = len(self.seen)
        end = self.now + round(seconds * SECOND)
        while self.now < end:
            self.now = min(self.now + round(step_s * SECOND), end)
            self.rover.tick(self.now)
            self.seen += self.rover.outgoing(self.now)
        return self.seen[before:]

    def send(self, can_id: int, data: bytes = b"") -> list[Frame]:
        """Send a frame and return the immediate answers."""
        before = len(self.seen)
        self.rover.take(Frame(1_700_000_000 * SECOND + self.now, can_id, data), self.now)
        self.seen += self.rover.outgoing(self.now)
        return self.seen[before:]

    def sync(self) -> dict[int, bytes]:
        """Send a SYNC and return the PDOs that answer it, by COB-ID."""
        return {frame.can_id: frame.data for frame in self.send(0x80)}

    def nmt(self, command: int, node_id: int = 0) -> list[Frame]:
        """Send an NMT command to a node, or to all (0)."""
        return self.send(0, bytes((command, node_id)))

    def heartbeat(self) -> None:
        """Send the master's heartbeat."""
        self.send(0x700 + MASTER_ID, b"\x05")

    def request(self, node_id: int, request: bytes) -> bytes:
        """Send an SDO request and return its answer; raise AbortedError for an abort."""
        answers = [f.data for f in self.send(0x600 + node_id, request) if f.can_id == 0x580 + node_id]
        assert len(answers) == 1, f"node {node_id} gave {len(answers)} answers to {request.hex()}"
        if answers[0][0] == 0x80:
            raise AbortedError(struct.unpack_from("<I", answers[0], 4)[0])
        return answers[0]

    def read(self, node_id: int, index: int, sub: int = 0) -> int:
        """Return an object's value by expedited upload, as an unsigned number."""
        answer = self.request(node_id, struct.pack("<BHBI", 0x40, index, sub, 0))
        assert answer[0] & 0xF3 == 0x43, "not an expedited answer"
        return int.from_bytes(answer[4 : 8 - ((answer[0] >> 2) & 3)], "little")

    def write(self, node_id: int, index: int, sub: int, value: int, size: int) -> None:
        """Write a number of `size` bytes by expedited download."""
        data = value.to_bytes(size, "little", signed=value < 0).ljust(4, b"\0")
        answer = self.request(node_id, struct.pack("<BHB", 0x23 | (4 - size) << 2, index, sub) + data)
        assert answer[:4] == struct.pack("<BHB", 0x60, index, sub)

    def configure(self, node_id: int, *, tpdo: tuple[int, ...], rpdo: tuple[int, ...] = (), kind: int = 1) -> None:
        """Map and enable TPDO 1 (of transmission type `kind`) and RPDO 1 (at once); entries as in 0x1A00."""
        for communication, mapping, base, entries, transmission in (
            (0x1800, 0x1A00, 0x180, tpdo, kind),
            (0x1400, 0x1600, 0x200, rpdo, 255),
        ):
            if not entries:
                continue
            self.write(node_id, communication, 1, 0x8000_0000 | base + node_id, 4)
            self.write(node_id, communication, 2, transmission, 1)
            self.write(node_id, mapping, 0, 0, 1)
            for sub, entry in enumerate(entries, start=1):
                self.write(node_id, mapping, sub, entry, 4)
            self.write(node_id, mapping, 0, len(entries), 1)
            self.write(node_id, communication, 1, base + node_id, 4)


MOTOR_TPDO = (0x60410010, 0x60780010, 0x606C0020)
MOTOR_RPDO = (0x60400010, 0x60FF0020)
LOAD_CELL_TPDO = (0x91300120, 0x61500108)


class DriveUnderTest:
    """Motor controller 1, the only node of its rover, configured and operational."""

    def __init__(self) -> None:
        self.master = Master(KAPVIK[:1])
        self.master.configure(1, tpdo=MOTOR_TPDO, rpdo=MOTOR_RPDO)
        self.master.nmt(1)

    def send_controlword(self, controlword: int, target_rpm: int = 0) -> int:
        """Send controlword and target, and return the state bits (mask 0x6F) that follow."""
        self.master.send(0x201, struct.pack("<Hi", controlword, target_rpm))
        return self.state

    @property
    def statusword(self) -> int:
        """0x6041, by SDO."""
        return self.master.read(1, 0x6041)

    @property
    def state(self) -> int:
        """The state bits of the statusword."""
        return self.statusword & 0x6F

    @property
    def speed_rpm(self) -> int:
        """0x606C, by SDO."""
        return struct.unpack("<i", struct.pack("<I", self.master.read(1, 0x606C)))[0]

    def enable(self) -> None:
        """Go through the states of CiA 402 to operation enabled."""
        for controlword in (0x06, 0x07, 0x0F):
            self.send_controlword(controlword)
        assert self.state == 0x27

    def run_at(self, rpm: int) -> None:
        """Enable, and wait until it turns at this speed."""
        self.enable()
        self.send_controlword(0x0F, rpm)
        self.master.wait(2)
        assert self.speed_rpm == rpm
