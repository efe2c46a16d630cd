"""The master's heartbeat consumer (CiA 301, 7.2.8.3.2): when a node counts as lost."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.nmt import NmtState

if TYPE_CHECKING:
    from regolithd.drivers.master.remote_node import RemoteNode

# After the heartbeat time has passed, frames may still wait in the socket because this program itself was late: a node
# is lost only when nothing arrives from it during this further time, in which the socket is read.
_GRACE_S = 0.05


@dataclass(frozen=True, slots=True)
class Loss:
    """How an operational node was lost; `silent`: its heartbeat has stopped, so it cannot be booted now."""

    text: str
    silent: bool


async def until_lost(remote: RemoteNode, lost_after_s: float) -> Loss:
    """Wait until an operational node is lost, and return how.

    A heartbeat wakes no task: seventy a second would cost more than the rest of an idle rover.
    """
    boot_ups, heard, began_s = remote.boot_ups, remote.heard, time.monotonic()

    def changed() -> bool:
        # Before its first heartbeat after the boot, the state is that of its boot-up message.
        return remote.boot_ups > boot_ups or (remote.heard > heard and remote.state is not NmtState.OPERATIONAL)

    def left_s() -> float:
        return lost_after_s - (time.monotonic() - max(began_s, remote.heard_s))

    while not await remote.state_changed.until(changed, left_s()):
        if left_s() <= 0.0 and not await _heard_within(remote, _GRACE_S):
            return Loss(f"no heartbeat for {lost_after_s:g} s", silent=True)
    if remote.boot_ups > boot_ups:
        return Loss("it restarted by itself", silent=False)
    return Loss(f"it left operational and reports {remote.state.text if remote.state else 'nothing'}", silent=False)


async def _heard_within(remote: RemoteNode, time_s: float) -> bool:
    before = remote.heard
    return await remote.changed.until(lambda: remote.heard > before, time_s)
