"""The model of `ground.toml`: broker, store and page of `regolithd ground`. Every key is optional."""

from __future__ import annotations

import ipaddress
from pathlib import Path  # pydantic reads it at run time
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from regolithd.calibration.parameters import Positive, Table
from regolithd.daemon.config.broker import BrokerSettings, broker_contradictions

if TYPE_CHECKING:
    from collections.abc import Iterator

Port = Annotated[int, Field(ge=1, le=65_535)]


class Broker(BrokerSettings):
    """`[mqtt]`: the broker to which the rovers publish."""

    client_id: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,64}$")] = "regolithd-ground"


class Store(Table):
    """`[store]`: folder and limits of the database."""

    directory: Path = Path("~/.local/share/regolithd/ground")
    limit_MB: Annotated[float, Field(ge=10)] = 10_000.0
    keep_days: Positive = 90.0

    @property
    def database(self) -> Path:
        """The database file."""
        return self.directory.expanduser() / "ground.sqlite"


class Page(Table):
    """`[page]`: address of the page, its certificate, and the file of users."""

    host: Annotated[str, Field(min_length=1)] = "127.0.0.1"
    port: Port = 8642
    certificate: Path | None = None
    key: Path | None = None
    users: Path | None = None

    @property
    def is_local(self) -> bool:
        """Whether only programs of this computer can reach the page."""
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"

    @property
    def url(self) -> str:
        """The page's address."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{'https' if self.certificate else 'http'}://{host}:{self.port}/"


class GroundSettings(Table):
    """The whole of `ground.toml`."""

    mqtt: Broker = Broker()
    store: Store = Store()
    page: Page = Page()


def checks_together(settings: GroundSettings) -> Iterator[tuple[str, str, str, str]]:
    """Yield key, expected value, found value and remedy of each contradiction between values."""
    page, mqtt = settings.page, settings.mqtt
    if (page.certificate is None) != (page.key is None):
        yield "page.key", "certificate and key together", "one of them", "Set both, or neither."
    if not page.is_local:
        if page.users is None:
            yield "page.users", "a file of users, where others can reach the page", "none", _ADD_USER
        if page.certificate is None:
            remedy = "Set certificate and key; or set host to 127.0.0.1, behind a proxy that has them."
            yield "page.certificate", "a certificate, where others can reach the page", "none", remedy
    yield from broker_contradictions(mqtt)


_ADD_USER = "Set it, and add users with `regolithd ground --add-user NAME`; or set host to 127.0.0.1."
