"""systemd's notification protocol, sd_notify(3): one datagram to the socket that NOTIFY_SOCKET names."""

from __future__ import annotations

import os
import socket

WATCHDOG = "WATCHDOG=1"
STOPPING = "STOPPING=1"
READY = "READY=1"


def notify(message: str) -> None:
    """Send a message to systemd; without systemd, do nothing. Lines such as `STATUS=…` may be joined by newlines."""
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
            return  # systemd does not listen, or its queue is full: messages repeat, so the next one will do


def watchdog_period_s() -> float | None:
    """Return half of WATCHDOG_USEC [s], or None where no watchdog is set for this process (sd_watchdog_enabled(3))."""
    microseconds = os.environ.get("WATCHDOG_USEC", "")
    mine = os.environ.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
    return int(microseconds) / 2e6 if microseconds.isdigit() and mine else None
