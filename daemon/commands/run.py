"""`regolithd run`: run the daemon."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.onnx_models import OnnxModels


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("run")(run)


def run(
    config: Annotated[Path, typer.Option(help="The rover's configuration (rover.toml).")] = Path(
        "/etc/regolithd/rover.toml"
    ),
    verbose: Annotated[bool, typer.Option("--verbose", help="Log at level DEBUG.")] = False,
) -> None:
    """Run the daemon: acquire, estimate, record and publish until SIGTERM or Ctrl-C.

    At its end it stops the drives, closes the recording and publishes `offline`.
    """
    import asyncio
    import gc
    import logging

    gc.disable()  # the start makes no garbage, and looking for it takes a tenth of its time

    from regolithd.daemon.pipeline.onnx_models import load_usable_models
    from regolithd.daemon.setup import configuration_or_exit

    logging.basicConfig(level=logging.DEBUG if verbose else logging.INFO, format="%(levelname)s %(name)s: %(message)s")
    configuration = configuration_or_exit(config)
    models = load_usable_models(configuration)
    asyncio.run(_run(configuration, models))


async def _run(configuration: Configuration, models: OnnxModels) -> None:
    import asyncio
    import gc
    import logging
    import os
    import signal

    from regolithd.daemon.publish.spool import SpoolError
    from regolithd.daemon.service import Service
    from regolithd.daemon.wiring import connect_sinks, open_stores

    try:
        stores = open_stores(configuration.mqtt)
    except SpoolError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from error
    service = Service(configuration, models)
    connect_sinks(service, stores)
    # Modules and models stay: each full collection would look through them, and delay a SYNC by tens of milliseconds.
    gc.collect()
    gc.freeze()
    gc.enable()
    task = asyncio.create_task(service.run())
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, task.cancel)
    await asyncio.wait([task])
    if not task.cancelled():
        task.result()  # raises after a bug: the traceback goes to the journal, and systemd restarts the daemon
    logging.shutdown()
    # Everything is closed. The thread that resolves the broker's name may still block for half a minute, and asyncio
    # would wait for it.
    os._exit(0)
