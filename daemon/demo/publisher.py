"""The thinnest publisher: live messages to a broker that is always there."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

import aiomqtt

from daemon.publish.encode import encode

if TYPE_CHECKING:
    from daemon.snapshot import Estimate
    from drivers.events import NetworkEvent


class DemoPublisher:
    """An outlet to the demo's own broker."""

    def __init__(self, port: int, prefix: str) -> None:
        self._port = port
        self._prefix = prefix
        self._waiting: asyncio.Queue[tuple[str, bytes]] = asyncio.Queue()

    def estimate(self, estimate: Estimate) -> None:
        """Queue its messages."""
        snapshot, wheels = encode(estimate, "demo")
        self._waiting.put_nowait(("snapshot", snapshot))
        for number, wheel in enumerate(wheels, start=1):
            self._waiting.put_nowait((f"wheel/{number}", wheel))

    def event(self, event: NetworkEvent) -> None:
        """Say nothing."""

    async def run(self) -> None:
        """Publish until cancelled."""
        async with aiomqtt.Client("127.0.0.1", self._port, identifier="regolithd") as client:
            await client.publish(f"{self._prefix}/state", b'{"state":"online"}', retain=True)
            while True:
                topic, payload = await self._waiting.get()
                await client.publish(f"{self._prefix}/{topic}", payload)
