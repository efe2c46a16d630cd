"""Protects the page: who may see it, from which other pages requests may come, what the browser may load.

| where | login | protection against other web sites |
|---|---|---|
| loopback, no users | none: whoever uses this computer | the Host header must name this computer |
| otherwise | password, session cookie | the cookie is SameSite=Strict; what changes something needs this Origin |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, RedirectResponse

if TYPE_CHECKING:
    from starlette.responses import Response
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

    from regolithd.daemon.ground.web.users import Logins

COOKIE = "regolithd"
PUBLIC = ("/login", "/static/page.css", "/static/login.js", "/static/icon.svg", "/favicon.ico")
"""Paths that need no login."""
LOCAL_HOSTS = {"localhost", "127.0.0.1", "[::1]"}
_HEADERS = {
    "content-security-policy": "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'self'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "same-origin",
}


class Protection:
    """ASGI middleware. `request.state.user` is the operator's name, or None where there is no login."""

    def __init__(self, app: ASGIApp, logins: Logins | None) -> None:
        self._app = app
        self._logins = logins

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer the request, or refuse it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_protected(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)  # a report has a policy of its own
            await send(message)

        request = Request(scope)
        refusal = self._refusal(request)
        await (refusal or self._app)(scope, receive, send_protected)

    def _refusal(self, request: Request) -> Response | None:
        if request.method == "POST" and not _is_own_page(request.headers):
            return PlainTextResponse("The request comes from another web page.", 403)
        if self._logins is None:
            request.state.user = None
            if _host(request.headers) not in LOCAL_HOSTS:
                return PlainTextResponse("This page answers to the name localhost only.", 421)
            return None
        request.state.user = self._logins.user(request.cookies.get(COOKIE))
        if request.state.user or request.url.path in PUBLIC:
            return None
        if request.url.path.startswith("/api"):
            return JSONResponse({"error": "You are not logged in."}, 401)
        return RedirectResponse("/login", 303)


def _host(headers: Headers) -> str:
    host = headers.get("host", "")
    return host[: host.rindex("]") + 1] if host.startswith("[") and "]" in host else host.partition(":")[0]


def _is_own_page(headers: Headers) -> bool:
    """Return whether a request was made by a page of this server; a browser names the page's origin."""
    origin = headers.get("origin")
    return origin is None or origin.partition("://")[2] == headers.get("host")
