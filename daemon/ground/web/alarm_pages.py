"""A page for each alarm: what it means and what to do, from the alarm guide; it needs no other network."""

from __future__ import annotations

import html
import re
from typing import TYPE_CHECKING

from starlette.responses import HTMLResponse
from starlette.routing import Route

from regolithd.daemon.messages.alarm_guide import guide_of

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

    from regolithd.daemon.messages.alarm_guide import AlarmGuide


async def alarm_page(request: Request) -> Response:
    """Return the page of an alarm; 404 for one that this version does not know."""
    name = request.path_params["name"]
    guide = guide_of(name)
    if guide is None:
        return HTMLResponse(_document(name, "<p>This version does not know the alarm.</p>"), 404)
    return HTMLResponse(_document(name, _body(guide)))


ALARM_ROUTES = [Route("/alarms/{name}", alarm_page)]


def _body(guide: AlarmGuide) -> str:
    actions = "".join(f"<li>{_marked(action)}</li>" for action in guide.actions)
    return (
        f"<p>{_marked(guide.meaning)}</p><h2>Consequence</h2><p>{_marked(guide.consequence)}</p>"
        f"<h2>What to do</h2><ul>{actions}</ul><h2>Ends when</h2><p>{_marked(guide.ends)}</p>"
    )


def _marked(text: str) -> str:
    """Return a text as HTML, with what stands in backticks as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(text))


def _document(name: str, body: str) -> str:
    title = f"Alarm {html.escape(name)}"
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<link rel="stylesheet" href="/static/page.css"></head><body><main><h1>{title}</h1>{body}</main></body></html>'
    )
