"""Frames in, signals out: a pure function of the frames, so that a log replayed gives the same as the bus did.

The predefined connection set (CiA 301, 7.3.3) says what a COB-ID is:

    0x000 NMT   0x080 SYNC   0x081–0x0FF EMCY   0x180–0x57F PDOs   0x580–0x67F SDO   0x701–0x77F heartbeat

`decode` never raises. What it has no use for (NMT, SDO, RPDOs, the master's own heartbeat) gives None; what it cannot
understand gives None as well and is counted by its reason.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from enum import StrEnum

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen.emcy import EMCY_COB_ID, parse
from regolithd.drivers.canopen.nmt import ERROR_CONTROL_COB_ID, NMT_COB_ID, parse_state
from regolithd.drivers.canopen.pdo import DIRECTED, Meaning, Pdo, Validity, rpdos, tpdos
from regolithd.drivers.signals import Emergency, NodeDescription, NodeState, Quantity, Reading, Signal, Sync

SYNC_COB_ID = 0x080
SDO_ANSWER_COB_ID = 0x580  # + node-ID, from the node
SDO_REQUEST_COB_ID = 0x600  # + node-ID, to the node
MASTER_ID = 127

_Handler = Callable[[Frame], Signal | None]


class Undecodable(StrEnum):
    """Why a frame could not be decoded."""

    UNKNOWN_COB_ID = "unknown-cob-id"  # no node of ours has it: a foreign node, or a wrong configuration
    WRONG_LENGTH = "wrong-length"  # not as long as its mapping, or its service, says
    UNKNOWN_STATE = "unknown-state"  # a heartbeat with a state that CiA 301 does not have
    EXTENDED = "extended"  # 29-bit identifier: not CANopen
    REMOTE = "remote"  # a remote request, which nobody here answers


class Decoder:
    """Decodes the frames of these nodes; `undecodable` counts what it could not, by reason."""

    def __init__(self, nodes: Iterable[NodeDescription], *, master_id: int = MASTER_ID) -> None:
        self.nodes = tuple(nodes)
        self.undecodable: Counter[Undecodable] = Counter()
        self._handlers: dict[int, _Handler] = {NMT_COB_ID: _nothing, SYNC_COB_ID: _sync}
        self._handlers[ERROR_CONTROL_COB_ID + master_id] = _nothing
        for node in self.nodes:
            self._add(node)

    @property
    def expected(self) -> frozenset[int]:
        """COB-IDs that a bus with every node operational carries after each SYNC."""
        return frozenset(
            pdo.cob_id(node.node_id) for node in self.nodes for pdo in tpdos(node.kind, diagnostics=node.diagnostics)
        )

    def decode(self, frame: Frame) -> Signal | None:
        """Return what a frame says, or None; never raises."""
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

    def _add(self, node: NodeDescription) -> None:
        handlers, node_id = self._handlers, node.node_id
        handlers[SDO_ANSWER_COB_ID + node_id] = _nothing
        handlers[SDO_REQUEST_COB_ID + node_id] = _nothing
        handlers[EMCY_COB_ID + node_id] = self._emergency(node)
        handlers[ERROR_CONTROL_COB_ID + node_id] = self._state(node_id)
        for pdo in rpdos(node.kind):
            handlers[pdo.cob_id(node_id)] = _nothing
        for pdo in tpdos(node.kind, diagnostics=node.diagnostics):
            handlers[pdo.cob_id(node_id)] = self._reading(pdo, node)

    def _emergency(self, node: NodeDescription) -> _Handler:
        def decode(frame: Frame) -> Emergency | None:
            emergency = parse(frame, node.node_id, node.kind)
            if emergency is None:
                self.undecodable[Undecodable.WRONG_LENGTH] += 1
            return emergency

        return decode

    def _state(self, node_id: int) -> _Handler:
        def decode(frame: Frame) -> NodeState | None:
            state = parse_state(frame.data)
            if state is None:
                known_length = len(frame.data) == 1
                self.undecodable[Undecodable.UNKNOWN_STATE if known_length else Undecodable.WRONG_LENGTH] += 1
                return None
            return NodeState(frame.time_ns, node_id, state)

        return decode

    def _reading(self, pdo: Pdo, node: NodeDescription) -> _Handler:
        node_id = node.node_id
        size, unpack, cob_id = pdo.layout.size, pdo.layout.unpack, pdo.cob_id(node_id)
        scales: tuple[tuple[int, Quantity, int, float], ...] = tuple(
            (place, meaning.quantity, -1 if node.mirrored and meaning.quantity in DIRECTED else 1, meaning.factor)
            for place, meaning in enumerate(pdo.meanings)
            if isinstance(meaning, Meaning)
        )
        masks = tuple((place, each.mask) for place, each in enumerate(pdo.meanings) if isinstance(each, Validity))

        def decode(frame: Frame) -> Reading | None:
            if len(frame.data) != size:
                self.undecodable[Undecodable.WRONG_LENGTH] += 1
                return None
            raw = unpack(frame.data)
            for place, mask in masks:
                if raw[place] & mask:
                    return Reading(frame.time_ns, node_id, cob_id, ())
            values = tuple([(quantity, sign * raw[place] * factor) for place, quantity, sign, factor in scales])
            return Reading(frame.time_ns, node_id, cob_id, values)

        return decode


def _nothing(_frame: Frame) -> None:
    return None


def _sync(frame: Frame) -> Sync:
    return Sync(frame.time_ns)
