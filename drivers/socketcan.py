"""SocketCAN, read by ourselves."""

from __future__ import annotations

from drivers.adapter import AdapterBus


class SocketCanBus(AdapterBus):
    """For the moment python-can's."""

    def __init__(self, channel: str) -> None:
        super().__init__("socketcan", channel)
