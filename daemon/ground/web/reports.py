"""The report of a rover's last comparison with the simulation, as a page of its own.

Its HTML comes over MQTT, from whoever may publish for the rover. Its headers therefore forbid the browser scripts,
requests, and access to the ground's page and cookies.
"""

from __future__ import annotations

import asyncio
import zlib
from base64 import b64decode
from contextlib import closing
from typing import TYPE_CHECKING

from pydantic_core import from_json
from starlette.responses import HTMLResponse, PlainTextResponse
from starlette.routing import Route

from regolithd.daemon.ground.store.database import open_reader
from regolithd.daemon.ground.store.history import History

if TYPE_CHECKING:
    from pathlib import Path

    from starlette.requests import Request
    from starlette.responses import Response

LARGEST = 20_000_000
"""Bytes of a page; one of 420 s of six wheels has 0.1 MB."""
_GZIP = zlib.MAX_WBITS | 16
_HEADERS = {"content-security-policy": "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox"}


class ReportPages:
    """The route `/report/{rover}`."""

    def __init__(self, database: Path) -> None:
        self._database = database
        self.routes = [Route("/report/{rover}", self._report)]

    async def _report(self, request: Request) -> Response:
        page = await asyncio.to_thread(self._page, request.path_params["rover"])
        if page is None:
            return PlainTextResponse("No comparison of this rover with the simulation has sent a readable report.", 404)
        return HTMLResponse(page, headers=_HEADERS)

    def _page(self, rover: str) -> bytes | None:
        with closing(open_reader(self._database)) as connection:
            message = History(connection).latest(rover).get("report")
        try:
            return html(message.payload) if message else None
        except (ValueError, LookupError, TypeError, zlib.error):
            return None


def html(payload: bytes) -> bytes:
    """Return the page of a `report` message, cut off at `LARGEST` bytes.

    Raises
    ------
    ValueError, LookupError, TypeError, zlib.error
        The payload is none.
    """
    compressed = b64decode(from_json(payload)["html_gzip"])
    return zlib.decompressobj(_GZIP).decompress(compressed, LARGEST)
