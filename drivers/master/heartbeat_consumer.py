"""The master's heartbeat consumer (CiA 301, 7.2.8.3.2): when a node counts as lost."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.drivers.can.bus import READ_WITHIN_S
from regolithd.drivers.canopen.nmt import NmtState

if TYPE_CHECKING:
    from regolithd.drivers.master.remote_node import RemoteNode


@dataclass(frozen=True, slots=True)
class Loss:
    """How an operational node was lost; `silent`: its heartbeat has stopped, so it cannot be booted now."""

    text: str
    silent: bool


class HeartbeatConsumer:
    """Monitors the heartbeats of all operational nodes; `run` must run meanwhile.

    A heartbeat wakes no task, and one timer serves all nodes, set to the earliest time at which one of them may be
    late: seventy heartbeats a second would otherwise cost more than the rest of an idle rover.
    """

    def __init__(self, lost_after_s: float) -> None:
        self._lost_after_s = lost_after_s
        self._monitored: dict[RemoteNode, float] = {}  # and when its monitoring began, on the monotonic clock

    async def run(self) -> None:
        """Wake the tasks that wait for a node's loss when its heartbeat is late; until cancelled."""
        while True:
            left_s = {node: self._left_s(node) for node in self._monitored}
            for node, each_s in left_s.items():
                if each_s <= 0.0:
                    node.state_changed.notify()
            # No other node can be late before this pause is over: not one that is monitored, or heard, from now on.
            await asyncio.sleep(min((each_s for each_s in left_s.values() if each_s > 0.0), default=self._lost_after_s))

    async def until_lost(self, remote: RemoteNode) -> Loss:
        """Wait until an operational node is lost, and return how."""
        self._monitored[remote] = time.monotonic()
        try:
            return await self._until_lost(remote)
        finally:
            del self._monitored[remote]

    async def _until_lost(self, remote: RemoteNode) -> Loss:
        boot_ups, heard = remote.boot_ups, remote.heard

        def left() -> bool:
            # Before its first heartbeat after the boot, the state is that of its boot-up message.
            return remote.heard > heard and remote.state is not NmtState.OPERATIONAL

        while True:
            await remote.state_changed.until(
                lambda: remote.boot_ups > boot_ups or left() or self._left_s(remote) <= 0.0
            )
            if remote.boot_ups > boot_ups:
                return Loss("it restarted by itself", silent=False)
            if left():
                what = remote.state.text if remote.state else "nothing"
                return Loss(f"it left operational and reports {what}", silent=False)
            if not await _heard_within(remote, READ_WITHIN_S):
                return Loss(f"no heartbeat for {self._lost_after_s:g} s", silent=True)

    def _left_s(self, remote: RemoteNode) -> float:
        return self._lost_after_s - (time.monotonic() - max(self._monitored[remote], remote.heard_s))


async def _heard_within(remote: RemoteNode, time_s: float) -> bool:
    before = remote.heard
    return await remote.changed.until(lambda: remote.heard > before, time_s)
