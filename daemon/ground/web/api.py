"""What the page reads and does: present state, history, log, alarm actions, downloads, live updates."""

from __future__ import annotations

import asyncio
import tempfile
import time
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, Field, ValidationError
from pydantic_core import from_json, to_json
from starlette.background import BackgroundTask
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from regolithd.daemon.ground.alarms.journal import AlarmJournal
from regolithd.daemon.ground.alarms.state import OPERATOR_ACTIONS, Action, RefusedError
from regolithd.daemon.ground.store.database import open_reader
from regolithd.daemon.ground.store.history import History
from regolithd.daemon.ground.store.series import SERIES
from regolithd.daemon.ground.web.tables import KINDS, csv_lines, write_parquet

if TYPE_CHECKING:
    from collections.abc import Iterator

    from starlette.requests import Request

    from regolithd.daemon.ground.alarms.journal import Entry
    from regolithd.daemon.ground.ground import Ground
    from regolithd.daemon.ground.store.history import Message, Points

LOG_LINES = 200
_LARGEST = 2**63 - 1
_LOGGED = ("event", "emcy", "state")


class AlarmAction(BaseModel):
    """The body of an action on an alarm."""

    action: Action
    minutes: float = Field(0.0, ge=0, allow_inf_nan=False)
    comment: str = Field("", max_length=500)
    who: str = Field("", max_length=64)


@dataclass(frozen=True, slots=True)
class LogLine:
    """A line of the list of events; `who` is the operator, empty for what a rover reported."""

    time_ms: float
    kind: str
    text: str
    late: bool = False
    who: str = ""


class Api:
    """The routes below `/api` and `/download`."""

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        self._path = ground.settings.store.database
        self.routes = [
            Route("/api/state", self._state),
            Route("/api/history/{rover}", self._history),
            Route("/api/log/{rover}", self._log),
            Route("/api/updates", self._updates),
            Route("/api/alarms/{rover}/{name}", self._act, methods=["POST"]),
            Route("/download/{rover}/{kind}.{format}", self._download),
        ]

    async def _state(self, request: Request) -> Response:
        live, now_ns = self._ground.live, time.time_ns()
        with closing(open_reader(self._path)) as connection:
            history = History(connection)
            rovers = {}
            for rover in sorted({*history.rovers(), *live.health}):
                messages = history.latest(rover)
                latest = {topic: from_json(message.payload) for topic, message in messages.items()}
                if rover in live.health:
                    latest["health"] = live.health[rover]
                data = [message.time_ns for topic, message in messages.items() if topic in SERIES]
                rovers[rover] = {
                    "latest": latest,
                    "alarms": self._ground.journal.reports(rover, now_ns),
                    "received_ms": live.received_ms.get(rover),
                    "data_ms": live.data_ms.get(rover) or max(data, default=0) / 1e6 or None,
                }
        subscription = self._ground.subscription
        return _json(
            {
                "now_ms": now_ns / 1e6,
                "broker": subscription.problem,
                "refused": subscription.refused,
                "user": request.state.user,
                "rovers": rovers,
            }
        )

    async def _history(self, request: Request) -> Response:
        rover, from_ns, to_ns = request.path_params["rover"], *_range_ns(request)
        return _json(await asyncio.to_thread(self._points, rover, from_ns, to_ns))

    def _points(self, rover: str, from_ns: int, to_ns: int) -> dict[str, Any]:
        with closing(open_reader(self._path)) as connection:
            history = History(connection)
            return {name: _columns(history.points(rover, name, from_ns, to_ns), name) for name in SERIES}

    async def _log(self, request: Request) -> Response:
        return _json(await asyncio.to_thread(self._log_lines, request.path_params["rover"]))

    def _log_lines(self, rover: str) -> list[LogLine]:
        """Return the newest lines of events, EMCY messages, connections and alarms, newest first."""
        with closing(open_reader(self._path)) as connection:
            history = History(connection)
            lines = [_logged(each) for topic in _LOGGED for each in history.newest(rover, topic, LOG_LINES)]
            lines += [_journal_line(name, entry) for name, entry in AlarmJournal.entries(connection, rover, LOG_LINES)]
        return sorted(lines, key=lambda line: line.time_ms, reverse=True)[:LOG_LINES]

    async def _updates(self, _request: Request) -> Response:
        headers = {"cache-control": "no-cache", "x-accel-buffering": "no"}
        return StreamingResponse(self._ground.live.updates(), media_type="text/event-stream", headers=headers)

    async def _act(self, request: Request) -> Response:
        rover, name = request.path_params["rover"], request.path_params["name"]
        try:
            wanted = AlarmAction.model_validate_json(await request.body())
        except ValidationError as error:
            return JSONResponse({"error": f"Not an action: {error.errors()[0]['msg']}"}, 400)
        who = request.state.user or wanted.who.strip()
        if not who:
            return JSONResponse({"error": "Enter your name first: it is stored with the action."}, 400)
        if wanted.action not in OPERATOR_ACTIONS:
            return JSONResponse({"error": f"An operator cannot do this: {wanted.action}"}, 400)
        now_ns = time.time_ns()
        until_ns = now_ns + int(wanted.minutes * 60e9) if wanted.action is Action.SHELVED else 0
        details = {"until_ns": until_ns, "comment": wanted.comment}
        try:
            self._ground.journal.operate(rover, name, wanted.action, who, now_ns, **details)
        except RefusedError as error:
            return JSONResponse({"error": str(error)}, 409)
        self._ground.live.alarms_changed(rover)
        return _json(self._ground.journal.reports(rover, now_ns))

    async def _download(self, request: Request) -> Response:
        rover, kind, form = (request.path_params[name] for name in ("rover", "kind", "format"))
        if kind not in KINDS or form not in {"csv", "parquet"}:
            return JSONResponse({"error": f"Tables are {', '.join(KINDS)}; formats are csv and parquet."}, 404)
        from_ns, to_ns = _range_ns(request)
        name = f"{rover}-{kind}.{form}"
        if form == "csv":
            headers = {"content-disposition": f'attachment; filename="{name}"'}
            lines = self._csv(rover, kind, from_ns, to_ns)
            return StreamingResponse(lines, media_type="text/csv; charset=utf-8", headers=headers)
        path = await asyncio.to_thread(self._parquet, rover, kind, from_ns, to_ns)
        return FileResponse(path, filename=name, background=BackgroundTask(path.unlink))

    def _csv(self, rover: str, kind: str, from_ns: int, to_ns: int) -> Iterator[bytes]:
        with closing(open_reader(self._path)) as connection:
            yield from csv_lines(kind, History(connection).messages(rover, KINDS[kind], from_ns, to_ns))

    def _parquet(self, rover: str, kind: str, from_ns: int, to_ns: int) -> Path:
        with (
            tempfile.NamedTemporaryFile(suffix=".parquet", delete=False) as file,
            closing(open_reader(self._path)) as connection,
        ):
            write_parquet(kind, History(connection).messages(rover, KINDS[kind], from_ns, to_ns), Path(file.name))
        return Path(file.name)


def _range_ns(request: Request) -> tuple[int, int]:
    """Return the time range of a request, `from` and `to` in ms; everything where they are left out."""

    def ns(name: str, default: int) -> int:
        try:
            return max(-_LARGEST, min(_LARGEST, int(float(request.query_params[name]) * 1e6)))
        except (KeyError, ValueError, OverflowError):
            return default

    return ns("from", 0), ns("to", time.time_ns() + 3_600_000_000_000)


def _columns(points: Points, channel: str) -> dict[str, Any]:
    names = SERIES[channel].names
    return {
        "spacing_s": points.spacing_s,
        "time_ms": points.time_ms.tolist(),
        "late": points.late.tolist(),
        "session": points.session.tolist(),
        "values": dict(zip(names, points.values.T.tolist(), strict=True)),
    }


def _json(content: object) -> Response:
    return Response(to_json(content, inf_nan_mode="null"), media_type="application/json")


def _logged(message: Message) -> LogLine:
    content = from_json(message.payload)
    text = content.get("text") or f"{content.get('state')}: {content.get('reason')}"
    return LogLine(message.time_ns / 1e6, content.get("kind", message.topic), text, message.late)


def _journal_line(name: str, entry: Entry) -> LogLine:
    told = "" if entry.who else entry.text
    text = f"{name} {entry.action.value}" + (f": {told or entry.comment}" if told or entry.comment else "")
    return LogLine(entry.time_ns / 1e6, "alarm", text, who=entry.who)
