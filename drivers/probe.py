"""A look at the bus that changes nothing: who answers, and who they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.bus import Bus
    from drivers.events import Identity
    from drivers.nmt import NmtState
    from drivers.signals import NodeDescription


@dataclass(frozen=True, slots=True)
class Probe:
    """What was found where a node should be. `problem` is empty where all is well, `cure` says what to do."""

    node: NodeDescription
    answers: bool
    identity: Identity | None
    nmt_state: NmtState | None
    problem: str
    cure: str


async def probe(bus: Bus, nodes: Sequence[NodeDescription], *, listen_s: float = 1.0) -> list[Probe]:
    """Ask every node who it is (SDO reads alone) and listen for heartbeats; nothing is moved or configured.

    Do not run it beside a daemon on the same bus: two SDO clients would answer to one another's replies.
    """
    raise NotImplementedError
