"""systemd's notification protocol, sd_notify(3): one datagram to the socket that it names in the environment."""

from __future__ import annotations

import os
import socket

WATCHDOG = "WATCHDOG=1"
STOPPING = "STOPPING=1"
READY = "READY=1"


def notify(message: str) -> None:
    """Tell systemd; without systemd, nothing happens. Lines such as `STATUS=…` may be joined by newlines."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address:
        return
    if address.startswith("@"):  # the abstract namespace
        address = "\0" + address[1:]
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as channel:
        try:
            channel.connect(address)
            channel.send(message.encode())
        except OSError:
            return  # systemd is gone or its queue is full: the next message tells it the same


def watchdog_period_s() -> float | None:
    """Return how often systemd wants to hear from us [s], or None where it does not (sd_watchdog_enabled(3))."""
    microseconds = os.environ.get("WATCHDOG_USEC", "")
    mine = os.environ.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
    return int(microseconds) / 2e6 if microseconds.isdigit() and mine else None
