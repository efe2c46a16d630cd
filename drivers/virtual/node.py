"""One CANopen node: the communication profile (CiA 301) around a device.

A node does no input or output and has no clock: frames arrive through `receive`, time through `tick`, and frames leave
through `emit` with the time at which they are due. Times are monotonic nanoseconds.
"""

from __future__ import annotations

from collections import Counter
from enum import IntEnum
from typing import TYPE_CHECKING

from regolithd.drivers.canopen import cob_id
from regolithd.drivers.canopen.sdo_abort import Abort, AbortError
from regolithd.drivers.devices.device import Measured
from regolithd.drivers.devices.profiles.identity import identity_entries
from regolithd.drivers.devices.virtual.device import Place
from regolithd.drivers.virtual import emcy, pdo
from regolithd.drivers.virtual.emcy import EmergencyProducer
from regolithd.drivers.virtual.faults import Faults
from regolithd.drivers.virtual.object_dictionary import Dictionary
from regolithd.drivers.virtual.sdo_server import SdoServer

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.drivers.can.frame import Frame
    from regolithd.drivers.devices.device import Device
    from regolithd.drivers.devices.node import NodeDescription
    from regolithd.drivers.devices.virtual.device import Key
    from regolithd.drivers.devices.virtual.measurement import Measurement

BOOT_NS = 20_000_000
"""From reset to boot-up."""

_DEVICE_TYPE = 0x1000
_SYNC_OBJECT, _CONSUMER, _PRODUCER, _IDENTITY, _ERROR_BEHAVIOUR = 0x1005, 0x1016, 0x1017, 0x1018, 0x1029
_STAYS, _STOPS = 1, 2  # values of 0x1029:01; 0 (the default) enters pre-operational


class VirtualNmtState(IntEnum):
    """NMT state, as in the heartbeat; `OFF` is a node without power."""

    OFF = -1
    INITIALISING = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


class VirtualNode:
    """One node. `emit(due_ns, can_id, data)` takes a frame; due 0 is at once.

    `counts` has the number of received and sent messages, by name.
    """

    def __init__(self, description: NodeDescription, emit: Callable[[int, int, bytes], None]) -> None:
        self.id = description.node_id
        self.description = description
        self.faults = Faults()
        self.counts: Counter[str] = Counter()
        self.state = VirtualNmtState.OFF
        self._emit = emit
        self._now = 0
        self.dictionary = Dictionary(description.device.eds, self.id)
        self._emergency = EmergencyProducer(self.dictionary, self._send_emergency)
        self.device = description.device.virtual(
            self.dictionary, self._emergency, description.wheel, _places(description.device)
        )
        self.device.direction = -1 if description.mirrored else 1
        self._sdo = SdoServer(self.dictionary)
        self.dictionary.on_write = self._check
        self.dictionary.after_write = self._written
        self._transmit: list[pdo.EnabledPdo] = []
        self._receive: dict[int, pdo.EnabledPdo] = {}
        self.sync_cob_id = -1
        self._boot_due: int | None = None
        self._heartbeat_due: int | None = None
        self._master_due: int | None = None  # runs only after the first heartbeat of the master (CiA 301, 7.2.8.3.2.2)
        self._master_lost = False

    # Power and network management

    def power_on(self, now: int) -> None:
        """Switch on: everything starts from its power-on values."""
        self._now = now
        if self.state is VirtualNmtState.OFF:
            self._reset(0x0000)

    def power_off(self) -> None:
        """Switch off; nothing is sent."""
        self.state = VirtualNmtState.OFF
        self._boot_due = self._heartbeat_due = self._master_due = None
        self._transmit, self._receive, self.sync_cob_id = [], {}, -1
        self.device.reset()

    def restart(self, now: int) -> None:
        """Reset by itself, as after a brown-out."""
        self._now = now
        self._reset(0x0000)

    def _reset(self, first: int) -> None:
        """Reset the objects from index `first` on: all, or communication (0x1000–0x1FFF) alone."""
        self.state = VirtualNmtState.INITIALISING
        self.dictionary.reset(first, 0xFFFF if first == 0 else 0x1FFF)
        self._identify()
        self._emergency.reset()
        self._sdo.reset()
        if first == 0:
            self.device.reset()
        self._master_due, self._heartbeat_due, self._master_lost = None, None, False
        self._boot_due = self._now + BOOT_NS
        self._configure()

    def _identify(self) -> None:
        """Set 0x1018: the expected identity, the node-ID as serial number, overridden by the injected fault."""
        self.dictionary.reset(_IDENTITY, _IDENTITY)
        known = identity_entries(self.description.device)
        self.dictionary.put(_DEVICE_TYPE, 0, known.pop(0, 0))
        for sub, value in (known | {4: self.id} | self.faults.identity).items():
            self.dictionary.put(_IDENTITY, sub, value)

    def _boot_up(self) -> None:
        self._boot_due = None
        if self.faults.no_boot_up:
            return
        self.state = VirtualNmtState.PRE_OPERATIONAL
        self.counts["boot_up"] += 1
        self._emit(0, cob_id.ERROR_CONTROL + self.id, b"\0")

    def _command(self, data: bytes) -> None:
        """Execute an NMT command (CiA 301, 7.2.8.2)."""
        if len(data) < 2 or data[1] not in {0, self.id}:
            return
        self.counts["nmt"] += 1
        command = data[0]
        if command == 0x01:
            self.enter(VirtualNmtState.OPERATIONAL)
        elif command == 0x02:
            self.enter(VirtualNmtState.STOPPED)
        elif command == 0x80:
            self.enter(VirtualNmtState.PRE_OPERATIONAL)
        elif command in {0x81, 0x82}:
            if command == 0x82:
                self.device.connection_lost()
            self._reset(0x0000 if command == 0x81 else 0x1000)

    def enter(self, state: VirtualNmtState) -> None:
        """Change the NMT state."""
        if state is self.state or self.state in {VirtualNmtState.OFF, VirtualNmtState.INITIALISING}:
            return
        self.state = state
        if state is VirtualNmtState.STOPPED:
            self.device.connection_lost()
        for each in self._transmit:
            each.syncs, each.sent, each.sent_ns = 0, None, self._now

    # Frames

    def receive(self, frame: Frame, now: int) -> None:
        """Take a frame of another node."""
        if (
            self.state in {VirtualNmtState.OFF, VirtualNmtState.INITIALISING}
            or frame.extended
            or frame.remote
            or frame.error
        ):
            return
        self._now = now
        can_id = frame.can_id
        if can_id == self.sync_cob_id:
            self._sync()
        elif can_id == cob_id.NMT:
            self._command(frame.data)
        elif can_id == cob_id.SDO_REQUEST + self.id:
            self._request(frame.data)
        elif can_id in self._receive:
            self._receive_rpdo(self._receive[can_id], frame.data)
        elif can_id == cob_id.ERROR_CONTROL + self._master and self._master:
            self._master_heartbeat()

    def _request(self, data: bytes) -> None:
        if self.state is VirtualNmtState.STOPPED or self.faults.no_sdo:
            return
        self.counts["sdo"] += 1
        answer = self._sdo.answer(data)
        if answer is not None:
            self._emit(0, cob_id.SDO_ANSWER + self.id, answer)

    def _sync(self) -> None:
        self.counts["sync"] += 1
        if self.state is not VirtualNmtState.OPERATIONAL:
            return
        for each in self._receive.values():
            if each.received is not None:
                self._apply(each, each.received)
                each.received = None
        for each in self._transmit:
            if not each.synchronous:
                continue
            each.syncs += 1
            if each.transmission_type == 0:
                self._send_if_changed(each)
            elif each.syncs >= each.transmission_type:
                self._send(each, each.content(self.dictionary))

    def _receive_rpdo(self, each: pdo.EnabledPdo, data: bytes) -> None:
        if self.state is not VirtualNmtState.OPERATIONAL or self.faults.deaf:
            return
        self.counts["rpdo"] += 1
        if len(data) < each.layout.size:
            self._emergency.report(emcy.PDO_TOO_SHORT)
            return
        if len(data) > each.layout.size:
            self._emergency.report(emcy.PDO_TOO_LONG)
        if each.synchronous:
            each.received = data
        else:
            self._apply(each, data)

    def _apply(self, each: pdo.EnabledPdo, data: bytes) -> None:
        start = 0
        for key in each.keys:
            end = start + self.dictionary.entries[key].bits // 8
            try:
                self.dictionary.write(key, data[start:end])
            except AbortError:  # out of range: a PDO cannot be refused, the old value stays
                self.counts["rpdo_refused"] += 1
            start = end

    # Time

    def due(self) -> int | None:
        """Return when `tick` has something to do, or None."""
        moments = [self._boot_due, self._heartbeat_due, self._master_due]
        if self.state is VirtualNmtState.OPERATIONAL:
            moments += [each.sent_ns + each.event_ns for each in self._transmit if each.event_ns]
        return min((moment for moment in moments if moment is not None), default=None)

    def tick(self, now: int) -> None:
        """Do what is due: boot up, heartbeat, loss of the master's heartbeat, timed PDOs."""
        self._now = now
        if self._boot_due is not None and now >= self._boot_due:
            self._boot_up()
        if self._heartbeat_due is not None and now >= self._heartbeat_due:
            self._heartbeat()
        if self._master_due is not None and now >= self._master_due:
            self._lose_master()
        if self.state is VirtualNmtState.OPERATIONAL:
            for each in self._transmit:
                if each.event_ns and now >= each.sent_ns + each.event_ns:
                    self._send(each, each.content(self.dictionary))

    def advance(self, elapsed_s: float) -> None:
        """Advance the device's time."""
        if self.state is not VirtualNmtState.OFF:
            self.device.advance(elapsed_s)

    def measure(self, measurement: Measurement, now: int) -> None:
        """Let the device measure; send what is event-driven and changed."""
        self._now = now
        if self.state in {VirtualNmtState.OFF, VirtualNmtState.INITIALISING}:
            return
        if not self.faults.frozen:
            self.device.measure(measurement)
        status = self.description.device.validity
        if self.faults.status and status is not None:
            raised = self.dictionary.get(status.index, status.subindex) | self.faults.status
            self.dictionary.put(status.index, status.subindex, raised)
        if self.state is VirtualNmtState.OPERATIONAL:
            for each in self._transmit:
                if not each.synchronous and now >= each.sent_ns + each.inhibit_ns:
                    self._send_if_changed(each)

    def _heartbeat(self) -> None:
        period = self.dictionary.get(_PRODUCER, missing=0) * 1_000_000
        due = self._heartbeat_due or 0
        # Keep the phase, but do not send what was missed.
        self._heartbeat_due = due + period if self._now < due + period else self._now + period
        if not self.faults.no_heartbeat and self.state is not VirtualNmtState.INITIALISING:
            self.counts["heartbeat"] += 1
            self._emit(0, cob_id.ERROR_CONTROL + self.id, bytes((self.state,)))

    @property
    def _master(self) -> int:
        return self.dictionary.get(_CONSUMER, 1, missing=0) >> 16 & 0x7F

    def _master_heartbeat(self) -> None:
        period = self.dictionary.get(_CONSUMER, 1, missing=0) & 0xFFFF
        if not period:
            return
        self._master_due = self._now + period * 1_000_000
        if self._master_lost:
            self._master_lost = False
            if not self.device.latches_errors:
                self._emergency.clear(emcy.HEARTBEAT_LOST)

    def _lose_master(self) -> None:
        """React to the loss of the master's heartbeat (0x1029, and the device's own 0x6007)."""
        self._master_due = None
        self._master_lost = True
        self.counts["master_lost"] += 1
        self.device.connection_lost()
        self._emergency.set(emcy.HEARTBEAT_LOST)
        behaviour = self.dictionary.get(_ERROR_BEHAVIOUR, 1, missing=0)
        if behaviour == _STOPS:
            self.enter(VirtualNmtState.STOPPED)
        elif behaviour != _STAYS and self.state is VirtualNmtState.OPERATIONAL:
            self.enter(VirtualNmtState.PRE_OPERATIONAL)

    # Sending

    def _send_if_changed(self, each: pdo.EnabledPdo) -> None:
        content = each.content(self.dictionary)
        if content != each.sent:
            self._send(each, content)

    def _send(self, each: pdo.EnabledPdo, content: bytes) -> None:
        each.syncs, each.sent, each.sent_ns = 0, content, self._now
        if self.faults.silent:
            return
        self.counts["tpdo"] += 1
        data = content[: len(content) - self.faults.missing_bytes] if self.faults.missing_bytes else content
        delay = self.faults.delay_ns
        self._emit(self._now + delay if delay else 0, each.cob_id, data)

    def _send_emergency(self, can_id: int, data: bytes) -> None:
        if self.state in {VirtualNmtState.PRE_OPERATIONAL, VirtualNmtState.OPERATIONAL}:
            self.counts["emcy"] += 1
            self._emit(0, can_id, data)

    def report(self, code: int) -> None:
        """Raise an error by command; 0 ends all."""
        if not code:
            self._emergency.clear()
        elif self.state is not VirtualNmtState.OFF:
            self._emergency.set(code)

    def override_identity(self, sub: int, value: int) -> None:
        """Report another value in 0x1018 from now on; sub-index 0 ends it."""
        if sub:
            self.faults.identity[sub] = value
        else:
            self.faults.identity = {}
        self._identify()

    # Writing to the object dictionary

    def _check(self, key: Key, value: int) -> None:
        index, sub = key
        if index in self.faults.refused:
            raise AbortError(Abort.HARDWARE)
        if index == emcy.HISTORY and value:
            raise AbortError(Abort.INVALID_VALUE)
        if index == emcy.COB_ID_OBJECT and (
            not pdo.usable(value) or pdo.moved_while_enabled(self.dictionary.get(index), value)
        ):
            raise AbortError(Abort.INVALID_VALUE)
        if index == _SYNC_OBJECT and (value & 0x6000_0000 or not value & 0x7FF):
            raise AbortError(
                Abort.INVALID_VALUE
            )  # these nodes neither produce a SYNC nor receive one with a 29-bit identifier
        if pdo.concerns_pdos(index):
            pdo.check(self.dictionary, key, value)
        self.device.check((index, sub), value)

    def _written(self, key: Key, value: int) -> None:
        index, _ = key
        if index in self.faults.forgotten:
            self.dictionary.values[key] = self.dictionary.entries[key].default
        elif index == emcy.HISTORY:
            for sub in range(1, 255):
                self.dictionary.put(emcy.HISTORY, sub, 0)
        elif index == _PRODUCER:
            self._heartbeat_due = self._now + value * 1_000_000 if value else None
        elif index == _CONSUMER:
            self._master_due, self._master_lost = None, False
        elif 0x1000 <= index < 0x2000:
            self._configure()
        else:
            self.device.written(key, value)

    def _configure(self) -> None:
        """Compile SYNC and PDO configuration from the communication objects."""
        self.sync_cob_id = self.dictionary.get(_SYNC_OBJECT, missing=cob_id.SYNC) & 0x7FF
        self._transmit = pdo.transmit_pdos(self.dictionary)
        self._receive = pdo.receive_pdos(self.dictionary)
        for each in self._transmit:
            each.sent_ns = self._now


def _places(device: Device) -> dict[str, Place]:
    """Return where each quantity of a device lies, by its name."""
    measured = (each for layout in device.tpdos for each in layout.objects if isinstance(each, Measured))
    return {each.quantity.name: Place(each.index, each.subindex, each.scale) for each in measured}
