"""Why there is no connection to the broker, in words for the person who reads the journal at night."""

from __future__ import annotations

import socket
import ssl
from typing import TYPE_CHECKING

from aiomqtt import MqttCodeError

if TYPE_CHECKING:
    from regolithd.daemon.config.configuration import Mqtt

_PASSWORD_CODES = (4, 5, 134, 135)  # CONNACK of MQTT 3.1.1, and what paho makes of it


def reason_of(error: Exception, settings: Mqtt) -> str:
    """Return what happened, and the cure where one is known."""
    place = f"MQTT broker {settings.host}:{settings.port}"
    cause = _root(error)
    match cause:
        case socket.gaierror():
            return f"{place}: the name cannot be resolved. Mend [mqtt] host, or the network's name service."
        case ConnectionRefusedError():
            return f"{place}: nobody listens there. Is the broker running, and is [mqtt] port right?"
        case ssl.SSLError():
            return f"{place}: TLS failed: {cause.reason}. Mend [mqtt] tls and ca_file, or the broker's certificate."
        case TimeoutError():
            return f"{place}: no answer. Is the machine on the network, and the broker not hung?"
        case OSError():
            return f"{place}: {cause}."
        case _:
            return f"{place}: {_refusal(error)}"


def _root(error: Exception) -> BaseException:
    """Return the system's own error behind aiomqtt's, which drops the type."""
    found: BaseException | None = error
    while found is not None and not isinstance(found, OSError):
        found = found.__cause__ or found.__context__
    return found or error


def _refusal(error: Exception) -> str:
    if "Disconnected" in str(error) or "connection was lost" in str(error):
        return "the connection was lost. If this repeats at once, another client has the same [rover] name."
    code = getattr(error.rc, "value", error.rc) if isinstance(error, MqttCodeError) else None
    if code in _PASSWORD_CODES:
        return "user name or password refused. Mend [mqtt] username and password_file, or the broker's password file."
    return f"{error}."
