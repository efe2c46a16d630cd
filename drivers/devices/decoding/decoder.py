"""Decodes frames to signals: a pure function of the frames, so that a replayed log gives the same as the bus did.

The COB-ID says which service a frame belongs to (`canopen.cob_id`). `decode` never raises. Frames that carry no signal
(NMT commands, SDO, RPDOs, the master's own heartbeat) give None; what cannot be decoded gives None as well and is
counted by its reason.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from enum import StrEnum
from typing import TYPE_CHECKING

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen import cob_id
from regolithd.drivers.canopen.emcy import Emergency, parse
from regolithd.drivers.canopen.nmt import parse_state
from regolithd.drivers.devices.decoding.pdo import DevicePdo, fixed_tpdos, rpdos, tpdos
from regolithd.drivers.devices.decoding.signals import NodeState, Reading, Signal, Sync
from regolithd.drivers.devices.decoding.stated_units import StatedUnits
from regolithd.drivers.devices.device import Measured, Quantity, Validity

if TYPE_CHECKING:
    from regolithd.drivers.devices.node import NodeDescription

_Handler = Callable[[Frame], Signal | None]


class Undecodable(StrEnum):
    """Why a frame could not be decoded."""

    UNKNOWN_COB_ID = "unknown-cob-id"  # of no configured node: a foreign node, or a wrong configuration
    WRONG_LENGTH = "wrong-length"  # not the length of its mapping or service
    UNKNOWN_STATE = "unknown-state"  # a heartbeat with a state that CiA 301 does not have
    EXTENDED = "extended"  # 29-bit identifier: not CANopen
    REMOTE = "remote"  # a remote request, which neither master nor nodes answer


class Decoder:
    """Decodes the frames of these nodes.

    Attributes
    ----------
    undecodable
        Frames that it could not decode, by reason.
    malformed
        Those of configured nodes among them, by reason and node-ID.
    """

    def __init__(self, nodes: Iterable[NodeDescription], *, master_id: int = cob_id.MASTER_NODE_ID) -> None:
        self.nodes = tuple(nodes)
        self.undecodable: Counter[Undecodable] = Counter()
        self.malformed: Counter[tuple[Undecodable, int]] = Counter()
        self._handlers: dict[int, _Handler] = {cob_id.NMT: _nothing, cob_id.SYNC: _sync}
        self._handlers[cob_id.ERROR_CONTROL + master_id] = _nothing
        self._units: list[StatedUnits] = []
        for node in self.nodes:
            self._add(node)

    @property
    def expected(self) -> frozenset[int]:
        """COB-IDs that a bus with every node operational carries after each SYNC."""
        return frozenset(
            pdo.cob_id(node.node_id) for node in self.nodes for pdo in tpdos(node.device, diagnostics=node.diagnostics)
        )

    @property
    def unit_frames(self) -> list[Frame]:
        """The last frames from which units were learned: with them, decoding can begin anew at any later frame."""
        return [frame for units in self._units for frame in units.frames.values()]

    def decode(self, frame: Frame) -> Signal | None:
        """Return the signal in a frame, or None; never raises."""
        if frame.error:
            return None  # the controller's report, not a message: `drivers.can.error_frame` reads it
        if frame.extended or frame.remote:
            self.undecodable[Undecodable.EXTENDED if frame.extended else Undecodable.REMOTE] += 1
            return None
        handler = self._handlers.get(frame.can_id)
        if handler is None:
            self.undecodable[Undecodable.UNKNOWN_COB_ID] += 1
            return None
        return handler(frame)

    def _count_malformed(self, reason: Undecodable, node_id: int) -> None:
        self.undecodable[reason] += 1
        self.malformed[reason, node_id] += 1

    def _add(self, node: NodeDescription) -> None:
        handlers, node_id = self._handlers, node.node_id
        units = StatedUnits(node.device)
        handlers[cob_id.SDO_ANSWER + node_id] = units.take if units else _nothing
        if units:
            self._units.append(units)
        handlers[cob_id.SDO_REQUEST + node_id] = _nothing
        handlers[cob_id.EMCY + node_id] = self._emergency(node)
        handlers[cob_id.ERROR_CONTROL + node_id] = self._state(node_id)
        for pdo in rpdos(node.device):
            handlers[pdo.cob_id(node_id)] = _nothing
        for pdo in tpdos(node.device, diagnostics=node.diagnostics):
            handlers[pdo.cob_id(node_id)] = self._reading(pdo, node, units)
        for other in fixed_tpdos(node.device, node_id):
            handlers.setdefault(other, _nothing)

    def _emergency(self, node: NodeDescription) -> _Handler:
        def decode(frame: Frame) -> Emergency | None:
            emergency = parse(frame, node.node_id, node.device.error_texts)
            if emergency is None:
                self._count_malformed(Undecodable.WRONG_LENGTH, node.node_id)
            return emergency

        return decode

    def _state(self, node_id: int) -> _Handler:
        def decode(frame: Frame) -> NodeState | None:
            state = parse_state(frame.data)
            if state is None:
                known_length = len(frame.data) == 1
                reason = Undecodable.UNKNOWN_STATE if known_length else Undecodable.WRONG_LENGTH
                self._count_malformed(reason, node_id)
                return None
            return NodeState(frame.time_ns, node_id, state)

        return decode

    def _reading(self, pdo: DevicePdo, node: NodeDescription, units: StatedUnits) -> _Handler:
        node_id = node.node_id
        size, unpack, own_cob_id = pdo.layout.size, pdo.layout.unpack, pdo.cob_id(node_id)
        scales = _scales(pdo, node, units)

        def rescale() -> None:
            nonlocal scales
            scales = _scales(pdo, node, units)

        units.notify(rescale)
        masks = tuple((place, each.mask) for place, each in enumerate(pdo.objects) if isinstance(each, Validity))

        def decode(frame: Frame) -> Reading | None:
            if len(frame.data) != size:
                self._count_malformed(Undecodable.WRONG_LENGTH, node_id)
                return None
            raw = unpack(frame.data)
            for place, mask in masks:
                if raw[place] & mask:
                    return Reading(frame.time_ns, node_id, own_cob_id, ())
            values = tuple([(quantity, sign * raw[place] * scale) for place, quantity, sign, scale in scales])
            return Reading(frame.time_ns, node_id, own_cob_id, values)

        return decode


def _scales(pdo: DevicePdo, node: NodeDescription, units: StatedUnits) -> tuple[tuple[int, Quantity, int, float], ...]:
    """Return place, quantity, sign and factor of each measured object whose unit is known."""
    return tuple(
        (place, each.quantity, -1 if node.mirrored and each.quantity.mirrored else 1, factor)
        for place, each in enumerate(pdo.objects)
        if isinstance(each, Measured) and (factor := units.factor(each.scale)) is not None
    )


def _nothing(_frame: Frame) -> None:
    return None


def _sync(frame: Frame) -> Sync:
    return Sync(frame.time_ns, frame.sent)
