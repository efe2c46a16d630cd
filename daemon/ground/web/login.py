"""Login and logout."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from pydantic import BaseModel, ValidationError
from starlette.responses import FileResponse, JSONResponse, RedirectResponse
from starlette.routing import Route

from regolithd.daemon.ground.web.protection import COOKIE
from regolithd.daemon.ground.web.users import SESSION_S

if TYPE_CHECKING:
    from pathlib import Path

    from starlette.requests import Request
    from starlette.responses import Response

    from regolithd.daemon.ground.web.users import Logins


class Credentials(BaseModel):
    """The body of a login."""

    name: str
    password: str


class LoginPages:
    """Their routes."""

    def __init__(self, logins: Logins, page: Path) -> None:
        self._logins = logins
        self._page = page
        self.routes = [
            Route("/login", self._show, methods=["GET"]),
            Route("/login", self._log_in, methods=["POST"]),
            Route("/logout", self._log_out, methods=["POST"]),
        ]

    async def _show(self, _request: Request) -> Response:
        return FileResponse(self._page)

    async def _log_in(self, request: Request) -> Response:
        address = request.client.host if request.client else ""
        if wait_s := self._logins.blocked_s(address):
            text = f"Too many wrong passwords. Try again in {wait_s / 60:.0f} min."
            return JSONResponse({"error": text}, 429, headers={"retry-after": f"{wait_s:.0f}"})
        try:
            given = Credentials.model_validate_json(await request.body())
        except ValidationError:
            return JSONResponse({"error": "Name and password are needed."}, 400)
        if not await asyncio.to_thread(self._logins.is_right, given.name, given.password):
            self._logins.failed(address)
            return JSONResponse({"error": "Name or password is wrong."}, 401)
        answer = JSONResponse({"user": given.name})
        answer.set_cookie(
            COOKIE,
            self._logins.begin(given.name, address),
            max_age=SESSION_S,
            httponly=True,
            secure=request.url.scheme == "https",
            samesite="strict",
        )
        return answer

    async def _log_out(self, request: Request) -> Response:
        self._logins.end(request.cookies.get(COOKIE, ""))
        answer = RedirectResponse("/login", 303)
        answer.delete_cookie(COOKIE)
        return answer
