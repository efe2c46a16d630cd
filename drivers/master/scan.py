"""A look at the bus that changes nothing: who answers, and who they are.

Each node is asked for 0x1000 and 0x1018 by SDO, and its heartbeat is listened for. Nothing is reset, written or moved.
A node that sends no heartbeat (none was configured) has no known NMT state, which is no problem by itself.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.nmt import NmtState
from regolithd.drivers.errors import BusError, SdoError
from regolithd.drivers.master.boot import compare_identity, read_identity
from regolithd.drivers.master.boot_reason import CURES, BootReason
from regolithd.drivers.master.remote_node import Link

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from regolithd.drivers.can.bus import Bus
    from regolithd.drivers.can.frame import Frame
    from regolithd.drivers.master.events import Identity
    from regolithd.drivers.signals import NodeDescription


@dataclass(frozen=True, slots=True)
class Probe:
    """What was found where a node should be. `problem` is empty where all is well, `cure` says what to do."""

    node: NodeDescription
    answers: bool
    identity: Identity | None
    nmt_state: NmtState | None
    problem: str = ""
    cure: str = ""


async def probe(
    bus: Bus, nodes: Sequence[NodeDescription], *, listen_s: float = 1.0, sdo_timeout_s: float = 0.5
) -> list[Probe]:
    """Ask every node who it is, all at once, and listen for heartbeats for `listen_s`.

    The bus must have no other reader in this program. Beside a daemon that is booting nodes an answer may be taken for
    another's; beside one that runs it is safe.
    """
    links = [Link(bus, node, sdo_timeout_s=sdo_timeout_s) for node in nodes]
    handlers: dict[int, Callable[[Frame], None]] = {}
    for link in links:
        handlers |= link.handlers
    async with asyncio.TaskGroup() as tasks:
        reader = tasks.create_task(_read(bus, handlers))
        asking = [tasks.create_task(_ask(link)) for link in links]
        await asyncio.sleep(listen_s)
        await asyncio.wait(asking)
        reader.cancel()
    return [_probe(link, asked.result()) for link, asked in zip(links, asking, strict=True)]


async def _read(bus: Bus, handlers: Mapping[int, Callable[[Frame], None]]) -> None:
    async for batch in bus:
        for frame in batch:
            handler = handlers.get(frame.can_id)
            if handler is not None and frame.ordinary and not frame.sent:
                handler(frame)


async def _ask(link: Link) -> Identity | SdoError | BusError:
    try:
        return await read_identity(link)
    except (SdoError, BusError) as error:
        return error


def _probe(link: Link, found: Identity | SdoError | BusError) -> Probe:
    node, state = link.node, link.state
    if isinstance(found, BusError):
        return Probe(node, answers=False, identity=None, nmt_state=state, problem=str(found), cure=found.cure)
    if isinstance(found, SdoError):
        problem, cure = _silence(link, found)
        return Probe(node, answers=False, identity=None, nmt_state=state, problem=problem, cure=cure)
    difference = compare_identity(node, found)
    if difference is None:
        return Probe(node, answers=True, identity=found, nmt_state=state)
    reason, problem = difference
    return Probe(node, answers=True, identity=found, nmt_state=state, problem=problem, cure=CURES[reason])


def _silence(link: Link, error: SdoError) -> tuple[str, str]:
    if link.state is NmtState.STOPPED:
        return "it is in NMT state stopped, in which it answers nothing", "The daemon resets it when it starts"
    if link.state is not None:
        return f"its heartbeat says {link.state.words}, but: {error.what}", CURES[BootReason.NO_SDO_ANSWER]
    return error.what, CURES[BootReason.NO_BOOT_UP]
