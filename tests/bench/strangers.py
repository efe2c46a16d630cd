"""Slaves made of python-canopen's LocalNode: SDO server, NMT slave, heartbeat and EMCY producer of another stack.

    python strangers.py INTERFACE CHANNEL ID:KIND:EDS[:ODDITY|oINDEX_SUBINDEX=VALUE…] …      KIND: motor or load

python-canopen has no boot-up after a remote reset, no PDOs that follow a remote configuration, and no heartbeat
consumer that acts; they are here, and share no code with regolithd. A COB-ID is not changed while it is valid, and no
mapping while its PDO is (CiA 301): both are refused, as CANopenNode does. A line on standard input is a command:
`fault ID`, `die ID`, `current ID RAW`. Oddities: `late` (boots up 1.5 s after the reset), `elsewhere` (EMCY at
0x0C0 + ID, valid), `blocks` (answers an upload of more than four bytes with a block upload, until that is aborted).
"""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Self

import canopen
from canopen.objectdictionary import ODVariable, datatypes
from canopen.sdo import SdoAbortedError, SdoServer

if TYPE_CHECKING:
    from pathlib import Path

DISABLED = 0x8000_0000
IDENTIFIER = 0x7FF
LATE_S = 1.5
STATES = {"disabled": 0x40, "ready": 0x21, "on": 0x23, "enabled": 0x27, "stopping": 0x07, "fault": 0x08}
BLOCK_UPLOAD_INITIATED = 0xC2  # with the size (CiA 301, 7.2.4.3.14)
TORQUE_OBJECTS = {0x6071: 0x3, 0x6072: 0x6, 0x6076: 0x7, 0x6502: 0x7}  # with data types of CiA 301
RAMP = 20_000.0  # units of 0x606C per second
CURRENT_OBJECTS = ((0x6078, 0), (0x30D1, 2), (0x2027, 0))
CURRENT, IDLE_CURRENT = 55, 0
"""Raw value of the current while enabled, and otherwise."""
LOAD = 4725
"""Raw value of the load."""


class BlockOffering(SdoServer):
    """Answers an upload of more than four bytes with a block upload; after an abort, once with a segmented one."""

    offered = 0
    refused = False

    def init_upload(self, request: bytes) -> None:
        """Answer an upload request."""
        self._index, self._subindex = request[1] | request[2] << 8, request[3]
        size = len(self._node.get_data(self._index, self._subindex, check_readable=True))
        if size <= 4 or self.refused:
            self.refused = False
            super().init_upload(request)
            return
        self.offered += 1
        self.send_response(bytes((BLOCK_UPLOAD_INITIATED,)) + bytes(request[1:4]) + size.to_bytes(4, "little"))

    def request_aborted(self, data: bytes) -> None:
        """Take the client's abort."""
        self.refused = True
        super().request_aborted(data)


@dataclass
class Stranger:
    """One slave; `sets` are values that its maker gave it: identity, rated current and the like."""

    network: canopen.Network
    node_id: int
    eds: str
    kind: str
    oddities: tuple[str, ...] = ()
    sets: dict[tuple[int, int], int] = field(default_factory=dict)
    state: str = "disabled"
    speed: float = 0.0
    alive: bool = True
    current: int = CURRENT

    def __post_init__(self) -> None:
        """Join the network, as after power-on."""
        self.node = self.network.create_node(self.node_id, self.eds)
        if "blocks" in self.oddities:
            self.node.sdo.__class__ = BlockOffering
            name = ODVariable("Manufacturer device name", 0x1008)
            name.data_type, name.default = datatypes.VISIBLE_STRING, "a name of more than seven bytes"
            self.node.object_dictionary.add_object(name)
        self.controlword = 0
        self.master_heard: float | None = None
        self.lost_master = 0
        self.fill()
        self.node.add_write_callback(self.written)
        self.network.subscribe(0x000, self.command)
        self.boot_up()

    # Object dictionary

    def variables(self) -> list[ODVariable]:
        """Return every entry of the object dictionary."""
        return [
            each
            for entry in self.node.object_dictionary.values()
            for each in ([entry] if isinstance(entry, ODVariable) else entry.values())
        ]

    def fill(self) -> None:
        """Give every object its power-on value."""
        self.node.data_store.clear()
        for each in self.variables():
            if each.default is None and each.data_type in datatypes.NUMBER_TYPES:
                self.put(each.index, each.subindex, 0)
        for (index, subindex), value in self.sets.items():
            self.put(index, subindex, value)
        self.put(0x1018, 4, self.node_id)
        if "elsewhere" in self.oddities:
            self.put(0x1014, 0, 0x0C0 + self.node_id)
        self.state, self.speed, self.controlword, self.master_heard = "disabled", 0.0, 0, None
        self.show()

    def get(self, index: int, subindex: int = 0, *, signed: bool = False) -> int:
        """Return a number, 0 where there is no such object."""
        try:
            return int.from_bytes(self.node.get_data(index, subindex), "little", signed=signed)
        except SdoAbortedError:
            return 0

    def put(self, index: int, subindex: int, value: float) -> None:
        """Set a number where there is such an object."""
        each = self.node.object_dictionary.get_variable(index, subindex)
        if each is not None and each.data_type in datatypes.NUMBER_TYPES:
            raw = float(value) if each.data_type in datatypes.FLOAT_TYPES else round(value)
            self.node.data_store.setdefault(index, {})[subindex] = each.encode_raw(raw)

    def written(self, *, index: int, subindex: int, od: ODVariable, data: bytes) -> None:
        """Refuse what CiA 301 forbids; act on the rest."""
        value = int.from_bytes(data, "little", signed=od.data_type in datatypes.SIGNED_TYPES)
        self.check_cob_id(index, subindex, value)
        if index == 0x6040:
            self.control(value)
        elif index == 0x6060:
            self.put(0x6061, 0, value)

    def check_cob_id(self, index: int, subindex: int, value: int) -> None:
        """Abort a change of an identifier in use, and of the mapping of a PDO in use."""
        if index == 0x1014 or (subindex == 1 and (0x1400 <= index < 0x1600 or 0x1800 <= index < 0x1A00)):
            before = self.get(index, subindex)
            if not (before | value) & DISABLED and (before ^ value) & IDENTIFIER:
                raise SdoAbortedError(0x06090030)
        if 0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00:
            cob_id = self.node.object_dictionary.get_variable(index - 0x200, 1)
            if cob_id.writable and not self.get(index - 0x200, 1) & DISABLED:
                raise SdoAbortedError(0x06010000)

    # Network management

    def command(self, _can_id: int, data: bytes, _time: float) -> None:
        """Take an NMT command; python-canopen itself takes start, stop and pre-operational."""
        if data[1] not in {0, self.node_id} or data[0] not in {129, 130} or not self.alive:
            return
        self.node.nmt.stop_heartbeat()
        self.fill()
        if "late" in self.oddities:
            self.node.nmt._state = 0
            threading.Timer(LATE_S, self.boot_up).start()
        else:
            self.boot_up()

    def boot_up(self) -> None:
        """Send the boot-up message and enter pre-operational."""
        self.node.nmt._state = 127
        self.network.send_message(0x700 + self.node_id, b"\0")

    @property
    def operational(self) -> bool:
        """Whether PDOs are served."""
        return self.alive and self.node.nmt._state == 5

    def die(self) -> None:
        """Vanish, as without supply."""
        self.alive = False
        self.node.nmt.stop_heartbeat()
        self.node.remove_network()

    def fault(self) -> None:
        """Fail as with overcurrent."""
        self.state = "fault"
        self.put(0x603F, 0, 0x2310)
        self.put(0x1003, 0, 1)
        self.put(0x1003, 1, 0x2310)
        self.show()
        self.node.emcy.send(0x2310, 3)

    # PDOs

    def sync(self) -> None:
        """Send the synchronous TPDOs."""
        for each in range(4 if self.operational else 0):
            cob_id, kind = self.get(0x1800 + each, 1), self.get(0x1800 + each, 2)
            count = self.get(0x1A00 + each, 0)
            if not cob_id & IDENTIFIER or cob_id & DISABLED or kind > 240 or not count:
                continue
            mapped = [self.get(0x1A00 + each, k) for k in range(1, count + 1)]
            data = b"".join(self.node.get_data(m >> 16, m >> 8 & 0xFF)[: (m & 0xFF) // 8] for m in mapped)
            self.network.send_message(cob_id & IDENTIFIER, data)

    def receive(self, can_id: int, data: bytes) -> None:
        """Take an RPDO."""
        for each in range(4 if self.operational else 0):
            cob_id = self.get(0x1400 + each, 1)
            if cob_id & DISABLED or cob_id & IDENTIFIER != can_id:
                continue
            start = 0
            for k in range(1, self.get(0x1600 + each, 0) + 1):
                mapped = self.get(0x1600 + each, k)
                end = start + (mapped & 0xFF) // 8
                self.node.set_data(mapped >> 16, mapped >> 8 & 0xFF, bytes(data[start:end]))
                start = end

    # The device

    def control(self, word: int) -> None:
        """Follow the controlword (CiA 402)."""
        rising, self.controlword = word & ~self.controlword & 0x80, word
        if self.state == "fault":
            self.state = "disabled" if rising else "fault"
        elif not word & 2:
            self.state = "disabled"
        elif not word & 4:
            self.state = "stopping" if self.state == "enabled" else "disabled"
        elif word & 0xF == 6 and self.state != "stopping":
            self.state = "ready"
        elif word & 0xF == 7 and self.state in {"ready", "enabled"}:
            self.state = "on"
        elif word & 0xF == 15 and self.state == "on":
            self.state = "enabled"
        self.show()

    def show(self) -> None:
        """Put state, speed, current and load into the dictionary."""
        target = self.get(0x60FF, signed=True)
        word = STATES[self.state] | 0x200 | (0x1000 if abs(self.speed) < 1 else 0)
        self.put(0x6041, 0, word | (0x400 if self.state == "enabled" and abs(self.speed - target) < 1 else 0))
        self.put(0x606C, 0, self.speed)
        for index, subindex in CURRENT_OBJECTS:
            self.put(index, subindex, self.current if self.state == "enabled" else IDLE_CURRENT)
        if self.kind == "load":
            for index in (0x9130, 0x6130, 0x7130, 0x6401):
                self.put(index, 1, LOAD)

    def tick(self, elapsed_s: float) -> None:
        """Let time pass: ramp, and the loss of the master's heartbeat."""
        target = self.get(0x60FF, signed=True) if self.state == "enabled" else 0
        step = RAMP * elapsed_s
        self.speed += max(-step, min(step, target - self.speed))
        if self.state == "stopping" and abs(self.speed) < 1:
            self.state = "disabled"
        timeout_ms = self.get(0x1016, 1) & 0xFFFF
        if timeout_ms and self.master_heard and time.monotonic() - self.master_heard > timeout_ms / 1000:
            self.master_heard = None
            self.lost_master += 1
            if self.state == "enabled":
                self.state = "stopping"
        self.show()


class Strangers:
    """Several slaves on one bus, with a thread of their own; a context manager."""

    def __init__(self, interface: str, channel: str) -> None:
        self.network = canopen.Network()
        self.network.connect(interface=interface, channel=channel)
        self.nodes: dict[int, Stranger] = {}
        self.lock = threading.Lock()
        self._ended = threading.Event()
        self.network.subscribe(0x080, lambda *_: self._sync())
        for node_id in range(1, 128):
            self.network.subscribe(0x700 + node_id, self._heartbeat)
        for base in (0x200, 0x300, 0x400, 0x500):
            for node_id in range(1, 127):
                self.network.subscribe(base + node_id, self._receive)
        self._thread = threading.Thread(target=self._run)

    def add(self, node_id: int, eds: str, kind: str, *oddities: str, **sets: int) -> Stranger:
        """Power one more slave; `sets` are values by object name, `o6075_0=2000`."""
        keys = {(int(name[1:5], 16), int(name[6:], 16)): value for name, value in sets.items()}
        self.nodes[node_id] = Stranger(self.network, node_id, eds, kind, oddities, keys)
        return self.nodes[node_id]

    def __enter__(self) -> Self:
        """Let time pass."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """End the thread and leave the bus."""
        self._ended.set()
        self._thread.join()
        for each in self.nodes.values():
            each.node.nmt.stop_heartbeat()
        self.network.disconnect()

    def _sync(self) -> None:
        for each in list(self.nodes.values()):
            each.sync()

    def _heartbeat(self, can_id: int, _data: bytes, _time: float) -> None:
        for each in self.nodes.values():
            if each.get(0x1016, 1) >> 16 & 0x7F == can_id & 0x7F:
                each.master_heard = time.monotonic()

    def _receive(self, can_id: int, data: bytes, _time: float) -> None:
        if node := self.nodes.get(can_id & 0x7F):
            node.receive(can_id, data)

    def _run(self) -> None:
        before = time.monotonic()
        while not self._ended.wait(0.02):
            now = time.monotonic()
            for each in list(self.nodes.values()):
                each.tick(now - before)
            before = now


def torque_eds(folder: Path) -> Path:
    """Write the EDS file of a CiA 402 drive with torque modes, and return its path."""
    from regolithd.drivers.devices.eds import EDS_FOLDER  # noqa: PLC0415  # the slaves share no code with regolithd

    sections = [
        f"[{index:04X}]\nParameterName=Torque object\nObjectType=0x7\nDataType=0x{kind:04X}\nAccessType=rw\n"
        "DefaultValue=0\nPDOMapping=1\n"
        for index, kind in TORQUE_OBJECTS.items()
    ]
    path = folder / "brake.eds"
    path.write_text((EDS_FOLDER / "cia402.eds").read_text() + "\n" + "\n".join(sections))
    return path


def obey(strangers: Strangers, line: str) -> None:
    """Execute a command."""
    word, *rest = line.split()
    if word == "fault":
        strangers.nodes[int(rest[0])].fault()
    elif word == "die":
        strangers.nodes[int(rest[0])].die()
    elif word == "current":
        strangers.nodes[int(rest[0])].current = int(rest[1])


def main() -> None:
    """Serve the bus until standard input ends."""
    interface, channel, *described = sys.argv[1:]
    with Strangers(interface, channel) as strangers:
        for each in described:
            node_id, kind, eds, *more = each.split(":")
            sets = dict(one.split("=") for one in more if "=" in one)
            oddities = [one for one in more if "=" not in one]
            strangers.add(int(node_id), eds, kind, *oddities, **{name: int(sets[name], 0) for name in sets})
        sys.stdout.write(f"ready: {len(strangers.nodes)} strangers\n")
        sys.stdout.flush()
        with contextlib.suppress(KeyboardInterrupt):
            for line in sys.stdin:
                obey(strangers, line)


if __name__ == "__main__":
    main()
