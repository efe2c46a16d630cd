"""Every node on the bus, whatever the configuration says: identity, state, errors; nothing is changed.

Object 0x1000 of each of the 127 node-IDs is read by SDO, sixteen at a time, while heartbeats are awaited. What answers
or sends is asked for its identity (0x1018), name (0x1008), error register (0x1001) and error history (0x1003).
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.drivers.canopen import cob_id
from regolithd.drivers.canopen.nmt import NmtState, parse_state
from regolithd.drivers.canopen.sdo_client import SdoClient
from regolithd.drivers.errors import SdoError
from regolithd.drivers.master.events import Identity
from regolithd.drivers.master.intruders import sender

if TYPE_CHECKING:
    from regolithd.drivers.can.bus import Bus
    from regolithd.drivers.can.frame import Frame

NODE_IDS = range(1, 128)
_AT_ONCE = 16
_SECOND_ANSWER_S = 0.02  # within which a second node with the same node-ID answers as well
_HISTORY = 5  # newest errors that are read
_NAME, _ERROR_REGISTER, _ERROR_HISTORY = 0x1008, 0x1001, 0x1003


@dataclass(slots=True)
class FoundNode:
    """A node that answered or sent. `errors`: the codes in its history, the newest first; None is not known.

    `shared`: one request was answered twice, so two nodes have this node-ID.
    """

    node_id: int
    identity: Identity | None = None
    name: str = ""
    nmt_state: NmtState | None = None
    error_register: int | None = None
    errors: tuple[int, ...] = ()
    shared: bool = False
    frames: int = 0
    sdo_answers: int = 0

    @property
    def profile_number(self) -> int | None:
        """The CiA device profile, in the lower 16 bits of 0x1000."""
        return None if self.identity is None else self.identity.device_type & 0xFFFF


class Survey:
    """Asks and listens. The bus must have no other reader in this program; times in seconds."""

    def __init__(self, bus: Bus, *, sdo_timeout_s: float = 0.3, listen_s: float = 1.0) -> None:
        self._bus = bus
        self._sdo_timeout_s = sdo_timeout_s
        self._listen_s = listen_s
        self._found: dict[int, FoundNode] = {}
        self._clients: dict[int, SdoClient] = {}

    async def run(self) -> list[FoundNode]:
        """Return every node on the bus, by node-ID.

        Raises
        ------
        BusError
            Nothing can be sent.
        """
        async with asyncio.TaskGroup() as tasks:
            reader = tasks.create_task(self._read())
            end = asyncio.get_running_loop().time() + self._listen_s
            for first in NODE_IDS[::_AT_ONCE]:
                await asyncio.gather(*(self._probe(each) for each in range(first, min(first + _AT_ONCE, 128))))
            await asyncio.sleep(max(0.0, end - asyncio.get_running_loop().time()))
            await asyncio.gather(*(self._ask(node) for node in self._found.values() if node.identity))
            reader.cancel()
        return [self._found[node_id] for node_id in sorted(self._found)]

    async def _read(self) -> None:
        async for batch in self._bus:
            for frame in batch:
                if frame.ordinary and not frame.sent:
                    self._take(frame)

    def _take(self, frame: Frame) -> None:
        node_id = sender(frame.can_id)
        if not node_id:
            return
        node = self._found.setdefault(node_id, FoundNode(node_id))
        node.frames += 1
        if frame.can_id == cob_id.ERROR_CONTROL + node_id:
            state = parse_state(frame.data)
            node.nmt_state = NmtState.PRE_OPERATIONAL if state is NmtState.BOOT_UP else state
        elif frame.can_id == cob_id.SDO_ANSWER + node_id:
            node.sdo_answers += 1
            if client := self._clients.get(node_id):
                client.handle(frame)

    async def _probe(self, node_id: int) -> None:
        """Read device type and identity; a node that does not answer is none, unless it sends."""
        sdo = self._clients[node_id] = SdoClient(self._bus, node_id, timeout_s=self._sdo_timeout_s)
        try:
            device_type = await sdo.read_number(0x1000)
        except SdoError:
            return
        await asyncio.sleep(_SECOND_ANSWER_S)
        shared = node_id in self._found and self._found[node_id].sdo_answers > 1
        rest = [await self._number(sdo, 0x1018, subindex) or 0 for subindex in (1, 2, 3, 4)]
        node = self._found.setdefault(node_id, FoundNode(node_id))
        node.identity, node.shared = Identity(device_type, *rest), shared

    async def _ask(self, node: FoundNode) -> None:
        sdo = self._clients[node.node_id]
        node.error_register = await self._number(sdo, _ERROR_REGISTER, 0)
        try:
            node.name = (await sdo.read(_NAME)).rstrip(b"\0").decode("latin-1").strip()
        except SdoError:
            node.name = ""
        count = await self._number(sdo, _ERROR_HISTORY, 0) or 0
        history = [await self._number(sdo, _ERROR_HISTORY, k) for k in range(1, min(count, _HISTORY) + 1)]
        node.errors = tuple(code & 0xFFFF for code in history if code)

    @staticmethod
    async def _number(sdo: SdoClient, index: int, subindex: int) -> int | None:
        try:
            return await sdo.read_number(index, subindex)
        except SdoError:
            return None
