"""The settings of a connection to an MQTT broker: in `rover.toml` and in `ground.toml`."""

from __future__ import annotations

import re
import stat
from contextlib import suppress
from ipaddress import ip_address
from pathlib import Path  # noqa: TC003  # pydantic reads it at run time
from typing import TYPE_CHECKING, Annotated

from pydantic import AfterValidator, Field

from regolithd.calibration.parameters import Table

if TYPE_CHECKING:
    from collections.abc import Iterator


_ADDRESS = re.compile(r"(?:(?P<scheme>[a-z]+)://)?(?P<host>[^/:\s]*)(?::(?P<port>\d+))?/?", re.IGNORECASE)


def _host(text: str) -> str:
    """Return a host's name or address; one with a scheme or a port is refused, with the keys that have them."""
    with suppress(ValueError):
        ip_address(text)
        return text
    match = _ADDRESS.fullmatch(text)
    if match is None:
        raise ValueError("a name or an address, such as rover.local or 10.0.0.2")
    if match["scheme"] is None and match["port"] is None and not text.endswith("/"):
        return text
    keys = f'host = "{match["host"]}"' + (f", port = {match['port']}" if match["port"] else "")
    secure = (match["scheme"] or "").lower() in {"mqtts", "ssl", "tls"}
    raise ValueError(f"a name or an address alone: {keys}{', tls = true' if secure else ''}")


class BrokerSettings(Table):
    """Address, topics, credentials and TLS of a connection.

    `socket` is the Unix socket of a broker on this computer; without it, `host` and `port` are used.
    `ca_file` holds the authorities whose broker certificates are accepted, by default those of the system. `cert_file`
    and `key_file` are the client's own certificate and its private key, which must have no passphrase.
    """

    socket: Path | None = None
    host: Annotated[str, Field(min_length=1), AfterValidator(_host)] = "localhost"
    port: Annotated[int, Field(ge=1, le=65_535)] = 1883
    prefix: Annotated[
        str,
        Field(pattern=r"^[^#+\s]*[^#+/\s]$", description="topic levels with / between them, without #, + and spaces"),
    ] = "regolith"
    username: str | None = None
    password_file: Path | None = None
    tls: bool = False
    ca_file: Path | None = None
    cert_file: Path | None = None
    key_file: Path | None = None
    keepalive_s: Annotated[int, Field(ge=2, le=3600)] = 10

    @property
    def address(self) -> str:
        """Where the broker is: the path of its socket, or host and port."""
        return f"{self.host}:{self.port}" if self.socket is None else str(self.socket)

    @property
    def client(self) -> str:
        """Whom the broker takes the client for: the user name, or the holder of the certificate."""
        if self.username is not None:
            return f"user {self.username!r}"
        return f"the client of {self.cert_file}" if self.cert_file else "a client without a user name"


def missing_credentials(mqtt: BrokerSettings) -> Iterator[tuple[str, str, str, str]]:
    """Yield key, expected value, found value and remedy of each file that is named and is not there.

    It is no reason to refuse the configuration: the daemon measures and records without a broker.
    """
    for key in ("password_file", "ca_file", "cert_file", "key_file"):
        path: Path | None = getattr(mqtt, key)
        try:
            found = path is None or stat.S_ISREG(path.stat().st_mode)
        except PermissionError:  # its folder is for the daemon alone, and so for this user it cannot be said
            continue
        except OSError:
            found = False
        if path is not None and not found:
            what = "a folder" if path.is_dir() else "not there"
            yield f"mqtt.{key}", "a file", f"{path}, which is {what}", "Write it, or correct the path."


def broker_contradictions(mqtt: BrokerSettings) -> Iterator[tuple[str, str, str, str]]:
    """Yield key, expected value, found value and remedy of each contradiction between the settings."""
    if mqtt.password_file is not None and mqtt.username is None:
        yield "mqtt.username", "a name beside password_file", "nothing", "Set it, or remove password_file."
    for given, missing in (("cert_file", "key_file"), ("key_file", "cert_file")):
        if getattr(mqtt, given) is not None and getattr(mqtt, missing) is None:
            yield f"mqtt.{missing}", f"a file beside {given}", "nothing", f"Set it, or remove {given}."
    if mqtt.socket is not None and mqtt.tls:
        yield "mqtt.tls", "false beside socket", "true", "A Unix socket has no TLS: set it to false, or remove socket."
    for key in ("ca_file", "cert_file", "key_file"):
        if getattr(mqtt, key) is not None and not mqtt.tls:
            yield (
                "mqtt.tls",
                f"true beside {key}",
                "false",
                f"Set it: certificates count with TLS only; or remove {key}.",
            )
            break
