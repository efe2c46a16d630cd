"""Puts the web application together, and serves it beside the ground's other tasks."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path
from typing import TYPE_CHECKING

import uvicorn
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.responses import FileResponse, RedirectResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from regolithd.daemon.ground.web.alarm_pages import ALARM_ROUTES
from regolithd.daemon.ground.web.api import Api
from regolithd.daemon.ground.web.login import LoginPages
from regolithd.daemon.ground.web.protection import Protection
from regolithd.daemon.ground.web.reports import ReportPages
from regolithd.daemon.ground.web.users import Logins, read_users

if TYPE_CHECKING:
    import socket

    from starlette.requests import Request
    from starlette.responses import Response

    from regolithd.daemon.ground.ground import Ground

PAGE = Path(__file__).resolve().parents[1] / "page"
STOP_TIMEOUT_S = 2


def application(ground: Ground) -> Starlette:
    """Return the web application.

    Raises
    ------
    UsersError
        The file of users cannot be used.
    """
    users = ground.settings.page.users
    logins = Logins(read_users(users), ground.connection, time.time) if users else None
    routes = [Route("/", _index), Route("/favicon.ico", _icon), *Api(ground).routes]
    routes += ALARM_ROUTES
    routes += ReportPages(ground.settings.store.database).routes
    routes += LoginPages(logins, PAGE / "login.html").routes if logins else []
    static = Mount("/static", StaticFiles(directory=PAGE))
    return Starlette(routes=[*routes, static], middleware=[Middleware(Protection, logins=logins)])


async def _index(_request: Request) -> Response:
    return FileResponse(PAGE / "index.html", headers={"cache-control": "no-cache"})


async def _icon(_request: Request) -> Response:
    return RedirectResponse("/static/icon.svg", 301)


async def serve(ground: Ground, app: Starlette, listening: socket.socket) -> None:
    """Serve until SIGINT or SIGTERM, which the server catches; then end the ground's other tasks."""
    page = ground.settings.page
    server = uvicorn.Server(
        uvicorn.Config(
            app,
            ssl_certfile=page.certificate,
            ssl_keyfile=page.key,
            log_level="warning",
            lifespan="off",
            server_header=False,
            timeout_graceful_shutdown=STOP_TIMEOUT_S,
        )
    )
    running = asyncio.create_task(ground.run())
    serving = asyncio.create_task(server.serve([listening]))
    try:
        await asyncio.wait({running, serving}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        server.should_exit = True
        running.cancel()
        await asyncio.wait({running, serving})
    for task in (serving, running):
        if not task.cancelled():
            task.result()
