"""Explains why there is no connection to the broker, and what to do, for the journal and `regolithd check`."""

from __future__ import annotations

import socket
import ssl
from typing import TYPE_CHECKING

from aiomqtt import MqttCodeError

if TYPE_CHECKING:
    from regolithd.daemon.config.configuration import Mqtt

_PASSWORD_CODES = (4, 5, 134, 135)  # CONNACK of MQTT 3.1.1, and what paho makes of it


def reason_of(error: Exception, settings: Mqtt) -> str:
    """Return what happened, and what to do where that is known."""
    place = f"MQTT broker {settings.host}:{settings.port}"
    cause = _root(error)
    match cause:
        case socket.gaierror():
            return f"{place}: the name cannot be resolved. Correct [mqtt] host, or the name service."
        case ConnectionRefusedError():
            return f"{place}: connection refused. Start the broker, or correct [mqtt] port."
        case ssl.SSLError():
            return f"{place}: TLS failed: {cause.reason}. Correct [mqtt] tls and ca_file, or the broker's certificate."
        case TimeoutError():
            return f"{place}: no answer. Check the network, and that the broker responds."
        case OSError():
            return f"{place}: {cause}."
        case _:
            return f"{place}: {_refusal(error)}"


def _root(error: Exception) -> BaseException:
    """Return the OSError that caused aiomqtt's error, or the error itself."""
    found: BaseException | None = error
    while found is not None and not isinstance(found, OSError):
        found = found.__cause__ or found.__context__
    return found or error


def _refusal(error: Exception) -> str:
    if "Disconnected" in str(error) or "connection was lost" in str(error):
        return "the connection was lost. If it repeats immediately, another client uses the same [rover] name."
    code = getattr(error.rc, "value", error.rc) if isinstance(error, MqttCodeError) else None
    if code in _PASSWORD_CODES:
        return (
            "user name or password refused. Correct [mqtt] username and password_file, or the broker's password file."
        )
    return f"{error}."
