"""How a broker is reached: over TCP, or by the Unix socket of a broker on this computer."""

from __future__ import annotations

import socket
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from regolithd.daemon.config.broker import BrokerSettings

TCP_OPTIONS = ((socket.IPPROTO_TCP, socket.TCP_NODELAY, 1),)
"""Without it a message waits until the one before it is acknowledged by TCP (Nagle's algorithm): up to 40 ms."""


@dataclass(frozen=True, slots=True)
class Transport:
    """What an MQTT client is given to connect; the host name of a Unix socket is its path."""

    host: str
    port: int
    kind: Literal["tcp", "unix"]
    socket_options: tuple[tuple[int, int, int], ...]

    def check_accepts(self) -> None:
        """Raise `OSError` where a Unix socket takes no connection now.

        The client's own attempt would wait without a limit: a broker that hangs leaves its queue of connections full.
        """
        if self.kind == "unix":
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK) as probe:
                probe.connect(self.host)


def transport_of(settings: BrokerSettings) -> Transport:
    """Return the transport of `[mqtt]`: `socket` where it is set, otherwise `host` and `port`."""
    if settings.socket is not None:
        return Transport(str(settings.socket), settings.port, "unix", ())
    return Transport(settings.host, settings.port, "tcp", TCP_OPTIONS)
