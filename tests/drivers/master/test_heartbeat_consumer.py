"""One timer for the heartbeats of all nodes."""

from __future__ import annotations

import asyncio
import time
from types import SimpleNamespace
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.nmt import NmtState
from regolithd.drivers.devices.decoding.signals import NodeState
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.master import heartbeat_consumer
from regolithd.drivers.master.heartbeat_consumer import HeartbeatConsumer, Loss
from regolithd.drivers.master.remote_node import RemoteNode

if TYPE_CHECKING:
    import pytest

SILENT = Loss("no heartbeat for 0.3 s", silent=True)


def operational(node_id: int) -> RemoteNode:
    """Return an operational node."""
    remote = RemoteNode(SimpleNamespace(), NodeDescription(node_id, MOTOR_CONTROLLER, 0), sdo_timeout_s=0.1)
    remote.take_state(NodeState(1, node_id, NmtState.OPERATIONAL))
    return remote


async def test_only_the_silent_node_is_lost() -> None:
    """After its heartbeat time, while the others are heard, whenever the monitoring of each began."""
    consumer, nodes = HeartbeatConsumer(0.3), [operational(number) for number in (1, 2, 3)]
    running = asyncio.ensure_future(consumer.run())
    waiting = []
    for node in nodes:
        waiting.append(asyncio.ensure_future(consumer.until_lost(node)))
        await asyncio.sleep(0.1)
    began = time.monotonic()
    while not waiting[1].done() and time.monotonic() < began + 10.0:
        for node in (nodes[0], nodes[2]):
            node.take_state(NodeState(2, node.node.node_id, NmtState.OPERATIONAL))
        await asyncio.sleep(0.05)
    assert 0.15 <= time.monotonic() - began < 5.0  # it was last heard at most 0.2 s before
    assert await waiting[1] == SILENT
    assert not waiting[0].done()
    assert not waiting[2].done()
    async with asyncio.timeout(10):
        assert await asyncio.gather(waiting[0], waiting[2]) == [SILENT, SILENT]
    running.cancel()


async def test_a_heartbeat_wakes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """In ten heartbeat times of ten nodes, the timer expires about as often as one node's would."""
    consumer, nodes = HeartbeatConsumer(0.1), [operational(number) for number in range(1, 11)]
    pauses: list[float] = []
    sleep = asyncio.sleep

    async def counted(delay: float) -> None:
        pauses.append(delay)
        await sleep(delay)

    monkeypatch.setattr(heartbeat_consumer, "asyncio", SimpleNamespace(sleep=counted))
    tasks = [asyncio.ensure_future(consumer.until_lost(node)) for node in nodes]
    await sleep(0)
    tasks.append(asyncio.ensure_future(consumer.run()))
    for _ in range(40):
        for node in nodes:
            node.take_state(NodeState(2, node.node.node_id, NmtState.OPERATIONAL))
        await sleep(0.025)
    assert not any(task.done() for task in tasks)
    assert 5 <= len(pauses) <= 25
    assert min(pauses) > 0.0
    for task in tasks:
        task.cancel()


async def test_a_node_that_is_heard_in_the_grace_time_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """The program was late, not the node; its next heartbeat time is monitored as the first was."""
    monkeypatch.setattr(heartbeat_consumer, "READ_WITHIN_S", 10.0)
    consumer, node = HeartbeatConsumer(0.05), operational(1)
    running = asyncio.ensure_future(consumer.run())
    waiting = asyncio.ensure_future(consumer.until_lost(node))
    for _ in range(4):
        await asyncio.sleep(0.12)
        assert not waiting.done()
        node.take_state(NodeState(2, 1, NmtState.OPERATIONAL))
    monkeypatch.setattr(heartbeat_consumer, "READ_WITHIN_S", 0.01)
    async with asyncio.timeout(10):
        assert await waiting == Loss("no heartbeat for 0.05 s", silent=True)
    running.cancel()
