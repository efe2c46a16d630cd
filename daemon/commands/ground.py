"""`regolithd ground`: receive what rovers publish, store it, and show it on a web page."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003  # typer reads it at run time
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from regolithd.daemon.ground.settings import GroundSettings

PACKAGES = ("starlette", "uvicorn", "pyarrow")


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("ground")(ground)


def ground(
    *,
    config: Annotated[
        Path | None, typer.Option(help="A ground.toml; without it, the defaults and a broker here.")
    ] = None,
    broker: Annotated[str | None, typer.Option(metavar="HOST[:PORT]", help="Instead of [mqtt] host and port.")] = None,
    add_user: Annotated[
        str | None, typer.Option(metavar="NAME", help="Ask for a password, add the user to [page] users, and exit.")
    ] = None,
) -> None:
    """Receive what all rovers publish, store it, and show it on one web page: a process of its own, on the ground.

    Only programs of this computer reach the page, unless [page] names another address; that needs users and a
    certificate. Ctrl-C ends it; the broker keeps what is published until it runs again.
    """
    from importlib.util import find_spec

    if missing := [name for name in PACKAGES if find_spec(name) is None]:
        typer.echo(f"the ground needs {', '.join(missing)}: pip install 'regolithd[ground]'", err=True)
        raise typer.Exit(1)
    settings = _settings_or_exit(config, broker)
    if add_user is not None:
        _add_user(settings, add_user)
    else:
        _run(settings)


def _settings_or_exit(config: Path | None, broker: str | None) -> GroundSettings:
    from regolithd.daemon.config.reader import EXIT_STATUS, ConfigurationError, read_tables
    from regolithd.daemon.ground.settings import Broker, GroundSettings, checks_together

    settings = GroundSettings()
    try:
        if config is not None:
            settings = read_tables(config, GroundSettings, checks_together)
        if broker is not None:
            host, _, port = broker.partition(":")
            changes = {"host": host} | ({"port": port} if port else {})
            changed = Broker.model_validate(settings.mqtt.model_dump() | changes)
            settings = settings.model_copy(update={"mqtt": changed})
    except ConfigurationError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_STATUS) from error
    except ValueError as error:
        typer.echo(f"--broker {broker}: not HOST or HOST:PORT", err=True)
        raise typer.Exit(EXIT_STATUS) from error
    return settings


def _add_user(settings: GroundSettings, name: str) -> None:
    from regolithd.daemon.config.reader import EXIT_STATUS
    from regolithd.daemon.ground.web.users import UsersError, add_user

    path = settings.page.users
    if path is None:
        typer.echo("name a file in [page] users of ground.toml, and give it with --config", err=True)
        raise typer.Exit(EXIT_STATUS)
    password = typer.prompt(f"Password of {name}", hide_input=True, confirmation_prompt=True)
    try:
        add_user(path, name, password)
    except UsersError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from error
    typer.echo(f"{name} can log in once `regolithd ground` is started again.")


def _run(settings: GroundSettings) -> None:
    import asyncio
    import logging

    from regolithd.daemon.ground.ground import Ground
    from regolithd.daemon.ground.store.database import StoreError
    from regolithd.daemon.ground.web.application import application, serve
    from regolithd.daemon.ground.web.listen import PageError, check_certificate, listen
    from regolithd.daemon.ground.web.users import UsersError

    logging.basicConfig(level=logging.INFO, format="%(levelname)s %(name)s: %(message)s")

    async def run() -> None:
        check_certificate(settings.page)
        listening = listen(settings.page)
        ground = Ground(settings)
        app = application(ground)
        typer.echo(f"{settings.page.url} shows what {settings.mqtt.address} receives")
        await serve(ground, app, listening)

    try:
        asyncio.run(run())
    except (PageError, StoreError, UsersError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from error
