"""A scan of the bus that changes nothing: which nodes answer, and their identity.

Objects 0x1000 and 0x1018 of each node are read by SDO, then every object of its boot configuration (`trial`), and its
heartbeat is awaited. Nothing is reset or written.
The NMT state of a node without heartbeat (none is configured) is unknown, which is not a fault.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from regolithd.drivers.canopen import cob_id
from regolithd.drivers.canopen.nmt import NmtState
from regolithd.drivers.devices.decoding.decoder import Decoder
from regolithd.drivers.devices.decoding.signals import NodeState
from regolithd.drivers.errors import BusError, SdoError
from regolithd.drivers.master.boot_error import REMEDIES, BootReason
from regolithd.drivers.master.identity import compare_identity, read_identity, reservations
from regolithd.drivers.master.remote_node import RemoteNode
from regolithd.drivers.master.trial import try_configuration

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.drivers.can.bus import Bus
    from regolithd.drivers.devices.node import NodeDescription
    from regolithd.drivers.master.events import Identity

_HEARTBEAT_S = 0.2  # any: only whether it can be written matters


@dataclass(frozen=True, slots=True)
class ScanResult:
    """What was found at the node-ID of a configured node. `problem` is empty where there is none.

    `differences`: what would prevent its boot, one text for each object. `reservations`: what cannot be checked.
    """

    node: NodeDescription
    answers: bool
    identity: Identity | None
    nmt_state: NmtState | None
    problem: str = ""
    remedy: str = ""
    differences: tuple[str, ...] = ()
    reservations: str = ""


async def scan(
    bus: Bus, nodes: Sequence[NodeDescription], *, listen_s: float = 1.0, sdo_timeout_s: float = 0.5
) -> list[ScanResult]:
    """Read every node's identity and configuration, all at once, and listen for heartbeats for `listen_s`.

    The bus must have no other reader in this program. While a daemon is booting nodes, its SDO answers may be mistaken
    for those to this scan; while it only acquires, that cannot happen.
    """
    remotes = [RemoteNode(bus, node, sdo_timeout_s=sdo_timeout_s) for node in nodes]
    async with asyncio.TaskGroup() as tasks:
        reader = tasks.create_task(_read(bus, remotes))
        asking = [tasks.create_task(_ask(remote)) for remote in remotes]
        await asyncio.sleep(listen_s)
        await asyncio.wait(asking)
        reader.cancel()
    found = [_result(remote, asked.result()[0]) for remote, asked in zip(remotes, asking, strict=True)]
    return [replace(each, differences=asked.result()[1]) for each, asked in zip(found, asking, strict=True)]


async def _read(bus: Bus, remotes: Sequence[RemoteNode]) -> None:
    decoder = Decoder(remote.node for remote in remotes)
    by_node_id = {remote.node.node_id: remote for remote in remotes}
    sdo_clients = {remote.answer_cob_id: remote.sdo for remote in remotes}
    async for batch in bus:
        for frame in batch:
            signal = decoder.decode(frame)
            if isinstance(signal, NodeState):
                by_node_id[signal.node_id].take_state(signal)
            elif frame.can_id in sdo_clients and frame.ordinary and not frame.sent:
                sdo_clients[frame.can_id].handle(frame)


async def _ask(remote: RemoteNode) -> tuple[Identity | SdoError | BusError, tuple[str, ...]]:
    """Return the identity, or why it could not be read; and what would prevent the boot of the expected device."""
    try:
        identity = await read_identity(remote)
        if compare_identity(remote.node, identity) is not None:
            return identity, ()
        return identity, await try_configuration(remote, heartbeat_s=_HEARTBEAT_S, master_id=cob_id.MASTER_NODE_ID)
    except (SdoError, BusError) as error:
        return error, ()


def _result(remote: RemoteNode, found: Identity | SdoError | BusError) -> ScanResult:
    node, state = remote.node, remote.state
    if isinstance(found, BusError):
        return ScanResult(node, answers=False, identity=None, nmt_state=state, problem=str(found), remedy=found.remedy)
    if isinstance(found, SdoError):
        problem, remedy = _no_answer(remote, found)
        return ScanResult(node, answers=False, identity=None, nmt_state=state, problem=problem, remedy=remedy)
    difference = compare_identity(node, found)
    if difference is None:
        return ScanResult(node, answers=True, identity=found, nmt_state=state, reservations=reservations(node, found))
    reason, problem = difference
    return ScanResult(node, answers=True, identity=found, nmt_state=state, problem=problem, remedy=REMEDIES[reason])


def _no_answer(remote: RemoteNode, error: SdoError) -> tuple[str, str]:
    if remote.state is NmtState.STOPPED:
        return "it is in NMT state stopped, in which it answers nothing", "The daemon resets it when it starts"
    if remote.state is not None:
        return f"its heartbeat reports {remote.state.text}, but: {error.what}", REMEDIES[BootReason.NO_SDO_ANSWER]
    return error.what, REMEDIES[BootReason.NO_BOOT_UP]
