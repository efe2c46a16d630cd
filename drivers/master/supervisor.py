"""Supervision of one node: boot it, monitor it, and boot it again after it was lost.

    booting ──▶ operational ──▶ lost
       │  ▲          ▲           │ sends again, or retry after a pause
       ▼  │          └── booting ◀
      failed

The other nodes are not affected when one is lost or returns.
"""

from __future__ import annotations

import asyncio
import time
from dataclasses import replace
from typing import TYPE_CHECKING

from regolithd.drivers.master.boot import BootSettings, boot
from regolithd.drivers.master.boot_error import BootError, BootReason
from regolithd.drivers.master.events import NetworkEvent, NodeBooted, NodeBootFailed, NodeLost, NodeReturned
from regolithd.drivers.master.identity import reservations
from regolithd.drivers.master.status import NetworkSettings, NodePhase, NodeStatus

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.drivers.master.heartbeat_consumer import HeartbeatConsumer
    from regolithd.drivers.master.remote_node import RemoteNode

_SILENT = (BootReason.NO_BOOT_UP, BootReason.NO_SDO_ANSWER, BootReason.FELL_SILENT, BootReason.BUS_DOWN)
_PAUSE_S = 0.1  # before a node that sends again is booted: it may restart several times


class Supervisor:
    """Supervises one node."""

    def __init__(
        self,
        remote: RemoteNode,
        settings: NetworkSettings,
        heartbeats: HeartbeatConsumer,
        emit: Callable[[NetworkEvent], None],
    ) -> None:
        self.remote = remote
        self.attempts = 0
        self._settings = settings
        self._boot_settings = BootSettings(
            heartbeat_s=settings.node_heartbeat_s,
            master_id=settings.master_id,
            master_lost_after_s=settings.master_lost_after_s,
            boot_up_timeout_s=settings.boot_up_timeout_s,
        )
        self._heartbeats = heartbeats
        self._emit = emit
        self._status = NodeStatus(remote.node)
        self._retry_s = settings.retry_after_s
        self._reported_lost = False  # reported as lost or failed, and has sent nothing since

    @property
    def status(self) -> NodeStatus:
        """Present status of the node."""
        return replace(self._status, nmt_state=self.remote.state, heard_ns=self.remote.heard_ns)

    @property
    def phase(self) -> NodePhase:
        """Phase of the node."""
        return self._status.phase

    def count_emergency(self) -> None:
        """Count an EMCY of this node."""
        self._status = replace(self._status, emergencies=self._status.emergencies + 1)

    async def run(self) -> None:
        """Boot the node and keep it operational, until cancelled."""
        while True:
            if await self._boot():
                silent = await self._monitor()
            else:
                silent = self._status.reason is not BootReason.RESTARTED
            if silent and not await self._heard_again():
                continue  # tried once more without an event: still lost, or failed, until it sends something
            await asyncio.sleep(_PAUSE_S)
            self._status = replace(self._status, phase=NodePhase.BOOTING)

    async def _boot(self) -> bool:
        node_id = self.remote.node.node_id
        try:
            identity = await boot(self.remote, self._boot_settings)
        except BootError as error:
            text = str(error)
            said_before = text == self._status.text
            self._status = replace(self._status, phase=NodePhase.FAILED, reason=error.reason, text=text)
            self._reported_lost = True
            if not said_before:  # one event, however often it is tried
                self._emit(NodeBootFailed(time.time_ns(), node_id, error.reason, text, error.remedy))
        else:
            self._note_return()
            boots = self._status.boots + 1
            text = f"node {node_id} ({self.remote.node.kind}) is operational{reservations(self.remote.node, identity)}"
            self._status = replace(
                self._status, phase=NodePhase.OPERATIONAL, identity=identity, reason=None, text=text, boots=boots
            )
            self._emit(NodeBooted(time.time_ns(), node_id, identity, text))
        self.attempts += 1
        self.remote.changed.notify()
        return self.phase is NodePhase.OPERATIONAL

    async def _monitor(self) -> bool:
        """Wait until the node is lost, and return whether its heartbeat stopped."""
        self._retry_s = self._settings.retry_after_s
        loss = await self._heartbeats.until_lost(self.remote)
        node_id = self.remote.node.node_id
        text = f"node {node_id} ({self.remote.node.kind}) lost: {loss.text}"
        self._status = replace(self._status, phase=NodePhase.LOST, text=text)
        self._emit(NodeLost(time.time_ns(), node_id, text))
        self._reported_lost = True
        return loss.silent

    def _note_return(self) -> None:
        if self._reported_lost:
            self._reported_lost = False
            node = self.remote.node
            text = f"node {node.node_id} ({node.kind}) sends again"
            self._emit(NodeReturned(time.time_ns(), node.node_id, text))

    async def _heard_again(self) -> bool:
        """Wait until the node sends again (where it had stopped) or boots up; return False after the retry time."""
        remote = self.remote
        heard, boot_ups = remote.heard, remote.boot_ups
        any_sign = self.phase is NodePhase.LOST or self._status.reason in _SILENT
        returned = await remote.changed.until(
            lambda: remote.boot_ups > boot_ups or (any_sign and remote.heard > heard), self._retry_s
        )
        if returned:
            self._retry_s = self._settings.retry_after_s
            self._note_return()
        else:
            self._retry_s = min(2.0 * self._retry_s, self._settings.retry_at_most_s)
        return returned
