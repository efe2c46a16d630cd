"""Checks the control socket: whether its group exists, the user may command, and a daemon is running."""

from __future__ import annotations

import asyncio
import os
from typing import TYPE_CHECKING

from regolithd.daemon.check.finding import Finding, good, unknown, warning, wrong
from regolithd.daemon.control.client import EX_NOPERM, ControlError, control_connection
from regolithd.daemon.control.protocol import Status, StatusRequest
from regolithd.daemon.control.socket import ControlSocketError, group_id

if TYPE_CHECKING:
    from regolithd.daemon.config.configuration import Configuration

TIMEOUT_S = 5.0


async def running_daemon(configuration: Configuration) -> Status | ControlError | None:
    """Return the status of the running daemon, the error if permission is missing, or None where none is running."""
    try:
        async with asyncio.timeout(TIMEOUT_S), control_connection(configuration.control.socket) as daemon:
            daemon.send(StatusRequest())
            reply = await daemon.reply()
    except ControlError as error:
        return error if error.exit_status == EX_NOPERM else None
    except (TimeoutError, ValueError):
        return None
    return reply if isinstance(reply, Status) else None


def check_control(configuration: Configuration, running: Status | ControlError | None) -> list[Finding]:
    """Return whether the rover can be commanded, and by this user."""
    control = configuration.control
    try:
        number = group_id(control.group)
    except ControlSocketError as error:
        what, _, remedy = str(error).partition(". ")
        return [wrong("control", what, remedy)]
    if isinstance(running, ControlError):
        what, _, remedy = str(running).partition(". ")
        return [warning("control", what, remedy)]
    member = os.geteuid() == 0 or number in {*os.getgroups(), os.getegid()}
    if not member:
        remedy = f"`sudo usermod -aG {control.group} $USER`, and log in again."
        return [warning("control", f"you are not in the group {control.group!r} and may not command the rover", remedy)]
    if running is None:
        if control.socket.exists() and not control.socket.is_socket():
            remedy = "Remove it, or choose another path: [control] socket."
            return [wrong("control", f"{control.socket} is not a socket", remedy)]
        return [unknown("control", f"you may command; no daemon is running at {control.socket}")]
    return [good("control", f"you may command; a daemon answers at {control.socket}")]
