"""A web browser's requests to an ASGI application in this process, without a server."""

from __future__ import annotations

import asyncio
import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from starlette.types import ASGIApp


@dataclass(frozen=True)
class Answer:
    """An answer: status, headers in lower case, and the whole body."""

    status: int
    headers: Mapping[str, str]
    body: bytes

    def json(self) -> Any:
        """Return the body as JSON."""
        return json.loads(self.body)


@dataclass
class Browser:
    """Asks one application as one client; `cookie` is sent along where it is set."""

    app: ASGIApp
    host: str = "localhost:8642"
    address: str = "10.0.0.9"
    scheme: str = "http"
    cookie: str = ""

    async def get(self, target: str, **headers: str) -> Answer:
        """Ask for a path, with its query."""
        return await self.ask("GET", target, b"", headers)

    async def post(self, target: str, content: object = None, **headers: str) -> Answer:
        """Send JSON."""
        return await self.ask("POST", target, json.dumps(content).encode(), headers)

    async def ask(self, method: str, target: str, body: bytes, headers: Mapping[str, str]) -> Answer:
        """Send a request and wait for the whole answer."""
        path, _, query = target.partition("?")
        named = {"host": self.host} | ({"cookie": self.cookie} if self.cookie else {}) | dict(headers)
        scope = {
            "type": "http",
            "http_version": "1.1",
            "method": method,
            "scheme": self.scheme,
            "path": path,
            "raw_path": path.encode(),
            "root_path": "",
            "query_string": query.encode(),
            "headers": [(name.encode(), value.encode()) for name, value in named.items()],
            "client": (self.address, 50_000),
            "server": ("127.0.0.1", 8642),
        }
        requests = iter([{"type": "http.request", "body": body, "more_body": False}])
        sent: list[Any] = []

        async def receive() -> Any:
            if request := next(requests, None):
                return request
            return await asyncio.Event().wait()  # a browser stays until it has the answer

        async def send(message: Any) -> None:
            sent.append(message)

        await self.app(scope, receive, send)
        answered = {name.decode().lower(): value.decode() for name, value in sent[0]["headers"]}
        return Answer(sent[0]["status"], answered, b"".join(message.get("body", b"") for message in sent[1:]))
