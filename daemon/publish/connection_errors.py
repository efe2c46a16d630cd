"""Explains why there is no connection to the broker, and what to do, for the journal and `regolithd check`."""

from __future__ import annotations

import errno
import socket
import ssl
from typing import TYPE_CHECKING

from aiomqtt import MqttCodeError
from paho.mqtt.enums import MQTTErrorCode
from paho.mqtt.reasoncodes import ReasonCode

from regolithd.daemon.publish.broker_client import PublishRefusedError
from regolithd.daemon.publish.tls_probe import NO_TLS_THERE, tls_problem

if TYPE_CHECKING:
    from regolithd.daemon.config.broker import BrokerSettings

_CREDENTIALS_CODES = (134, 135)  # CONNACK of MQTT 5; paho translates those of MQTT 3.1.1, 4 and 5, to them
_SESSION_TAKEN_OVER = 142
_LOST = frozenset(
    {
        MQTTErrorCode.MQTT_ERR_NO_CONN,
        MQTTErrorCode.MQTT_ERR_CONN_REFUSED,
        MQTTErrorCode.MQTT_ERR_CONN_LOST,
        MQTTErrorCode.MQTT_ERR_ERRNO,
        MQTTErrorCode.MQTT_ERR_KEEPALIVE,
    }
)
"""What paho returns for a publish once the connection is lost."""
_OF_ALERT = {
    "CERTIFICATE_EXPIRED": "the client certificate has expired. Renew [mqtt] cert_file, or correct the broker's clock",
    "UNKNOWN_CA": "the broker does not know the authority of the client certificate. Correct [mqtt] cert_file: it must"
    " be issued by the authority in the broker's cafile",
    "CERTIFICATE_REQUIRED": "the broker requires a client certificate. Set [mqtt] cert_file and key_file",
    "HANDSHAKE_FAILURE": "the broker refuses this client's TLS. Set [mqtt] cert_file and key_file, if it requires them",
    "CERTIFICATE_REVOKED": "the client certificate is revoked. Replace [mqtt] cert_file",
}
"""What the broker says of the client: the end of the alert's name in OpenSSL (RFC 8446, 6.2)."""
_OF_VERIFICATION = {
    9: "the broker's certificate is not valid yet. Set this computer's clock",
    10: "the broker's certificate has expired. Renew it, or set this computer's clock",
    18: "the broker's certificate is self-signed. Name it, or its authority, in [mqtt] ca_file",
    19: "the authority of the broker's certificate is not known. Name it in [mqtt] ca_file",
    20: "the authority of the broker's certificate is not known. Name it in [mqtt] ca_file",
    62: "the broker's certificate is for another host name. Correct [mqtt] host, or issue it with"
    " this name as subjectAltName",
    64: "the broker's certificate is for another address. Correct [mqtt] host, or issue it with this address as"
    " subjectAltName",
}
"""What this side finds wrong with the broker: OpenSSL's X509_V_ERR_… codes."""


async def explain(error: Exception, settings: BrokerSettings) -> str:
    """Return what happened, and what to do where that is known; tries TLS where the error itself does not say it."""
    cause = _root(error)
    if settings.socket is None and _may_be_tls(error, cause):
        found = await tls_problem(settings)
        if isinstance(found, str):
            return f"{_place(settings)}: {found}."
        if found is not None:
            return f"{_place(settings)}: {_tls_text(found)}."
    return reason_of(error, settings)


def reason_of(error: Exception, settings: BrokerSettings) -> str:
    """Return what happened by the error alone, and what to do where that is known."""
    cause = _root(error)
    if not isinstance(cause, OSError):
        text = _refusal(error, settings)
    elif settings.socket is not None and cause.filename is None:  # a file would be one of the credentials
        text = _of_unix_socket(cause)
    else:
        text = _of_ip(cause)
    return f"{_place(settings)}: {text}"


def _of_ip(error: OSError) -> str:
    match error:
        case socket.gaierror() | OSError(errno=errno.EAFNOSUPPORT) if not _may_use_ip():
            return (
                "its unit allows this service no Internet sockets. Set [mqtt] socket to that of a broker on this"
                " computer, or copy broker-over-ip.conf (docs/how-to/install.md)."
            )
        case socket.gaierror():
            return "the name cannot be resolved. Correct [mqtt] host, or the name service."
        case ConnectionRefusedError():
            return "connection refused. Start the broker, or correct [mqtt] port."
        case ssl.SSLError():
            return f"{_tls_text(error)}."
        case TimeoutError():
            return "no answer. Check the network, and that the broker responds."
        case _:
            return f"{error}."


def _of_unix_socket(error: OSError) -> str:
    match error:
        case FileNotFoundError():
            return "there is no such socket. Start the broker, or correct [mqtt] socket."
        case PermissionError():
            return "this user may not open it. Its folder must belong to the group of this user: `ls -ld`."
        case ConnectionRefusedError():
            return "connection refused. Start the broker, or correct [mqtt] socket."
        case TimeoutError() | BlockingIOError():
            return "no answer. Check that the broker responds."
        case _:
            return f"{error}."


def _may_use_ip() -> bool:
    """Return whether this process may open Internet sockets (`RestrictAddressFamilies=` of its unit)."""
    try:
        socket.socket(socket.AF_INET, socket.SOCK_STREAM).close()
    except OSError:
        return False
    return True


def _place(settings: BrokerSettings) -> str:
    return f"MQTT broker {settings.address}"


def _may_be_tls(error: Exception, cause: BaseException) -> bool:
    """Return whether the connection ended without a reason."""
    lost = isinstance(error, MqttCodeError) and not isinstance(error, PublishRefusedError) and _is_lost(error)
    return isinstance(cause, TimeoutError | ConnectionResetError | BrokenPipeError) or lost


def _root(error: Exception) -> BaseException:
    """Return the OSError that caused aiomqtt's error, or the error itself."""
    found: BaseException | None = error
    while found is not None and not isinstance(found, OSError):
        found = found.__cause__ or found.__context__
    return found or error


def _tls_text(error: ssl.SSLError) -> str:
    if isinstance(error, ssl.SSLCertVerificationError):
        other = f"TLS failed: {error.verify_message}. Correct [mqtt] ca_file, or the broker's certificate"
        return _OF_VERIFICATION.get(error.verify_code, other)
    reason = error.reason or ""
    if isinstance(error, ssl.SSLEOFError) or reason == "WRONG_VERSION_NUMBER":
        return NO_TLS_THERE
    known = next((text for alert, text in _OF_ALERT.items() if reason.endswith(alert)), None)
    return known or f"TLS failed: {reason}. Correct [mqtt] tls, the certificates, or the broker's settings"


def _is_lost(error: Exception) -> bool:
    return "Disconnected" in str(error) or "connection was lost" in str(error)


def _brokers_code(error: BaseException | None) -> int | None:
    """Return the reason code that the broker refused or ended the connection with, or None where it gave none.

    A number alone is an error of paho itself: its 4 (not connected) and 5 are no refusals of MQTT 3.1.1.
    """
    while error is not None:
        if isinstance(error, MqttCodeError) and isinstance(error.rc, ReasonCode):
            return int(error.rc.value)
        error = error.__cause__
    return None


def _refusal(error: Exception, settings: BrokerSettings) -> str:
    if isinstance(error, PublishRefusedError):
        return (
            f"{settings.client} may not publish on {error.topic}. Correct [mqtt] username or cert_file, [rover] name,"
            " or the broker's access rules."
        )
    code = _brokers_code(error)
    if code == _SESSION_TAKEN_OVER:
        return "another client uses the same [rover] name and took the connection over. Give each rover its own name."
    if _is_lost(error) or (isinstance(error, MqttCodeError) and isinstance(error.rc, int) and error.rc in _LOST):
        return "the connection was lost. If it repeats immediately, another client uses the same [rover] name."
    if code in _CREDENTIALS_CODES and settings.username is None:
        who = "the client certificate" if settings.cert_file else "a client without a user name"
        return f"{who} is refused. Set [mqtt] username and password_file, or correct the broker's access rules."
    if code in _CREDENTIALS_CODES:
        return (
            "user name or password refused. Correct [mqtt] username and password_file, or the broker's password file."
        )
    return f"{error}."
