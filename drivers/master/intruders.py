"""Who else is on the bus: nodes that the configuration does not know, and a second master.

| frame, not sent by this process | it is |
|---|---|
| boot-up, heartbeat, EMCY, TPDO 1 to 4 or SDO answer of another node-ID | a node that nobody expects |
| SYNC | a second SYNC producer: nodes sample at its SYNCs too |
| NMT command, or heartbeat with the master's node-ID | a second master: it may start, stop or reset nodes |

Node-IDs follow from the predefined connection set (CiA 301, 7.3.3); an object of the LSS or time-stamp services is
none. Each is one event when it is first seen, and again after it has been absent.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, TypeVar

from regolithd.drivers.canopen import cob_id
from regolithd.drivers.master.events import UnexpectedMaster, UnexpectedNode

if TYPE_CHECKING:
    from collections.abc import Iterable

    from regolithd.drivers.can.frame import Frame

ABSENT_NS = 5_000_000_000
"""An intruder that has sent nothing for this long is gone."""

_Key = TypeVar("_Key")
_NODE_ID = 0x7F
_FIRST_PDO, _LAST_PDO = 0x180, 0x57F
_TPDO_BIT = 0x080  # of a PDO's function code: set in the TPDOs of the predefined connection set


class Service(StrEnum):
    """What a second master does."""

    SYNC = "produces SYNC"
    NMT = "sends NMT commands"
    HEARTBEAT = "sends the master's heartbeat"


_REMEDIES = {
    Service.SYNC: "Switch off the production of SYNC there: bit 30 of its 0x1005",
    Service.NMT: "End the other master, or another daemon on this bus: only one may boot the nodes",
    Service.HEARTBEAT: "Give it another node-ID, or end the other daemon on this bus",
}


@dataclass(frozen=True, slots=True)
class Intruders:
    """Who is on the bus now, beside the configured nodes and this master."""

    nodes: tuple[int, ...] = ()
    services: tuple[Service, ...] = ()


class IntruderWatch:
    """Takes the frames that no configured node sent."""

    def __init__(self, node_ids: Iterable[int], *, master_id: int) -> None:
        self._known = frozenset(node_ids)
        self._master_id = master_id
        self._nodes: dict[int, int] = {}
        self._services: dict[Service, int] = {}

    def take(self, frame: Frame) -> UnexpectedNode | UnexpectedMaster | None:
        """Take a frame that this process did not send; return an event where it is an intruder's first."""
        if not frame.ordinary:
            return None
        if service := self._service(frame.can_id):
            new = _is_new(self._services, service, frame.time_ns)
            text = f"another master on the bus {service.value}"
            return UnexpectedMaster(frame.time_ns, text, _REMEDIES[service]) if new else None
        node_id = sender(frame.can_id)
        if not node_id or node_id in self._known:
            return None
        if not _is_new(self._nodes, node_id, frame.time_ns):
            return None
        text = f"node {node_id} is on the bus, and not in the configuration (identifier 0x{frame.can_id:03X})"
        return UnexpectedNode(frame.time_ns, node_id, text)

    def present(self, time_ns: int) -> Intruders:
        """Return who has sent something in the last `ABSENT_NS`."""
        nodes = sorted(each for each, seen in self._nodes.items() if time_ns - seen < ABSENT_NS)
        services = sorted(each for each, seen in self._services.items() if time_ns - seen < ABSENT_NS)
        return Intruders(tuple(nodes), tuple(services))

    def _service(self, can_id: int) -> Service | None:
        services = {
            cob_id.SYNC: Service.SYNC,
            cob_id.NMT: Service.NMT,
            cob_id.ERROR_CONTROL + self._master_id: Service.HEARTBEAT,
        }
        return services.get(can_id)


def _is_new(seen: dict[_Key, int], key: _Key, time_ns: int) -> bool:
    """Note that something was seen, and return whether it had been absent."""
    before = seen.get(key)
    seen[key] = time_ns
    return before is None or time_ns - before > ABSENT_NS


def sender(can_id: int) -> int:
    """Return the node-ID that sends frames with this identifier in the predefined connection set; 0 where none does."""
    node_id = can_id & _NODE_ID
    function = can_id - node_id
    transmitted = _FIRST_PDO <= can_id <= _LAST_PDO and function & _TPDO_BIT
    emergency = function == cob_id.EMCY
    return node_id if transmitted or emergency or function in {cob_id.SDO_ANSWER, cob_id.ERROR_CONTROL} else 0
