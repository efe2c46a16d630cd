"""What the page reads and does, asked in this process: state, history, log, actions on alarms, downloads."""

from __future__ import annotations

import csv
import io
import json
import math
from typing import TYPE_CHECKING, Any

import pyarrow.parquet as pq
import pytest
from asgi_client import Answer, Browser
from ground_messages import START_NS, received

from regolithd.daemon.ground.ground import Ground
from regolithd.daemon.ground.settings import GroundSettings
from regolithd.daemon.ground.web import api
from regolithd.daemon.ground.web.application import application

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

START_MS = START_NS / 1e6
HOUR_NS = 3_600_000_000_000


@pytest.fixture
def ground(tmp_path: Path) -> Iterator[Ground]:
    """A ground that has received a minute of one rover, and an alarm."""
    made = Ground(GroundSettings.model_validate({"store": {"directory": tmp_path / "store"}}))
    made.take([received("snapshot", number, float(number)) for number in range(60)])
    made.take(
        [
            received("state", 1, 0.5, state="online", reason="connected"),
            received("event", 1, 10.0, kind="node-lost", text="node 13 lost"),
            received("alarm/bus", 1, 20.0, name="bus", active=True, severity="error", text="bus is down"),
            received("health", 1, 30.0),
        ]
    )
    yield made
    made.connection.close()
    made._lock.close()


@pytest.fixture
def browser(ground: Ground, monkeypatch: pytest.MonkeyPatch) -> Browser:
    """A browser on this computer, an hour after the start."""
    monkeypatch.setattr(api.time, "time_ns", lambda: START_NS + HOUR_NS)
    return Browser(application(ground))


async def test_the_state_has_each_rover_s_newest_messages(browser: Browser, ground: Ground) -> None:
    """With its alarms, the health that is not stored, and when its data are from."""
    ground.take([received("snapshot", 1, 5.0, rover="blue"), received("state", 1, 4.0, rover="blue", state="offline")])
    ground.subscription.problem, ground.subscription.refused = "not connected", 3
    state = (await browser.get("/api/state")).json()
    assert (state["now_ms"], state["broker"], state["refused"]) == (START_MS + 3.6e6, "not connected", 3)
    assert list(state["rovers"]) == ["blue", "kapvik"]
    kapvik = state["rovers"]["kapvik"]
    assert kapvik["latest"]["snapshot"]["sequence"] == 59
    assert set(kapvik["latest"]) == {"snapshot", "state", "event", "alarm/bus", "health"}
    assert kapvik["data_ms"] == START_MS + 59_000
    assert [(each["name"], each["state"]) for each in kapvik["alarms"]] == [("bus", "unacknowledged")]
    assert state["rovers"]["blue"]["data_ms"] == START_MS + 5000


async def test_the_time_of_the_data_is_read_from_the_store_after_a_restart(browser: Browser, ground: Ground) -> None:
    """A rover without data has none."""
    ground.take([received("state", 1, 4.0, rover="blue")])
    ground.live.data_ms.clear()
    rovers = (await browser.get("/api/state")).json()["rovers"]
    assert rovers["kapvik"]["data_ms"] == START_MS + 59_000
    assert rovers["blue"]["data_ms"] is None


async def test_the_history_is_that_of_the_range(browser: Browser) -> None:
    """In columns by name; without a range it is everything since 1970, and so as coarse as can be."""
    asked = f"/api/history/kapvik?from={START_MS + 10_000}&to={START_MS + 20_000}"
    part, whole = (await browser.get(asked)).json(), (await browser.get("/api/history/kapvik")).json()
    assert [time_ms - START_MS for time_ms in part["snapshot"]["time_ms"]] == [1000.0 * k for k in range(10, 21)]
    assert {len(column) for column in part["snapshot"]["values"].values()} == {11}
    assert part["snapshot"]["late"] == [False] * 11
    assert set(part) == {"snapshot", "posterior", "odometry"}
    assert set(part["snapshot"]) == {"spacing_s", "time_ms", "late", "session", "values"}
    assert len(whole["snapshot"]["time_ms"]) == 1
    assert whole["snapshot"]["spacing_s"] == 900


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ("", (0, START_NS + 2 * HOUR_NS)),
        ("from=1.5&to=2", (1_500_000, 2_000_000)),
        ("from=x&to=", (0, START_NS + 2 * HOUR_NS)),
        ("from=-1e300&to=1e300", (-(2**63) + 1, 2**63 - 1)),
        ("from=nan&to=inf", (0, START_NS + 2 * HOUR_NS)),
    ],
)
async def test_a_range_is_in_milliseconds(
    query: str, expected: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is no number, or left out, is everything up to an hour from now; a huge one is the largest there is."""
    from starlette.requests import Request  # noqa: PLC0415

    monkeypatch.setattr(api.time, "time_ns", lambda: START_NS + HOUR_NS)
    assert api._range_ns(Request({"type": "http", "query_string": query.encode(), "headers": []})) == expected


async def test_the_log_has_the_newest_lines_first(browser: Browser, ground: Ground) -> None:
    """Events, connections and alarms together, two hundred at most; an operator's line has the name."""
    await browser.post("/api/alarms/kapvik/bus", {"action": "acknowledged", "who": "anna", "comment": "seen"})
    lines = (await browser.get("/api/log/kapvik")).json()
    assert [(line["kind"], line["text"], line["who"]) for line in lines] == [
        ("alarm", "bus acknowledged: seen", "anna"),
        ("alarm", "bus raised: bus is down", ""),
        ("node-lost", "node 13 lost", ""),
        ("state", "online: connected", ""),
    ]
    assert [line["time_ms"] - START_MS for line in lines] == [3_600_000, 20_000, 10_000, 500]
    ground.take([received("event", number, 100.0 + number, text=str(number), late=True) for number in range(2, 300)])
    lines = (await browser.get("/api/log/kapvik")).json()
    assert len(lines) == 200
    assert (lines[1]["text"], lines[1]["late"]) == ("299", True)


async def act(browser: Browser, **action: Any) -> Answer:
    """Do something to the alarm of the bus."""
    return await browser.post("/api/alarms/kapvik/bus", action)


async def test_an_action_is_stored_with_its_operator(browser: Browser, ground: Ground) -> None:
    """The answer has the alarms as they are now, and open pages are told; shelving is for minutes."""
    told: list[str] = []
    ground.live.alarms_changed = told.append  # type: ignore[method-assign]
    (alarm,) = (await act(browser, action="acknowledged", who=" anna ")).json()
    assert (alarm["state"], alarm["acknowledged_by"]) == ("acknowledged", "anna")
    (alarm,) = (await act(browser, action="shelved", who="berta", minutes=30)).json()
    assert (alarm["state"], alarm["shelved_by"]) == ("shelved", "berta")
    until = alarm["shelved_until"]
    (alarm,) = ground.journal.reports("kapvik", START_NS + HOUR_NS + 29 * 60 * 10**9)
    assert (alarm.state, alarm.shelved_until) == ("shelved", until)
    (alarm,) = ground.journal.reports("kapvik", START_NS + HOUR_NS + 31 * 60 * 10**9)
    assert alarm.state == "acknowledged"
    assert told == ["kapvik", "kapvik"]


@pytest.mark.parametrize(
    ("action", "status", "told"),
    [
        ({"action": "acknowledged"}, 400, "Enter your name first"),
        ({"action": "acknowledged", "who": "  "}, 400, "Enter your name first"),
        ({"action": "cleared", "who": "anna"}, 400, "An operator cannot do this: cleared"),
        ({"action": "dance", "who": "anna"}, 400, "Not an action: "),
        ({"action": "shelved", "who": "anna", "minutes": -1}, 400, "Not an action: "),
        ({"action": "shelved", "who": "anna", "minutes": math.inf}, 400, "Not an action: "),
        ({"action": "shelved", "who": "anna", "minutes": math.nan}, 400, "Not an action: "),
        ({"action": "shelved", "who": "anna", "comment": "x" * 501}, 400, "Not an action: "),
        ({"action": "shelved", "who": "a" * 65, "minutes": 1}, 400, "Not an action: "),
        ({"action": "reset", "who": "anna"}, 409, ""),
        ({"action": "shelved", "who": "anna", "minutes": 481}, 409, ""),
    ],
)
async def test_what_is_no_action_is_refused_with_the_reason(
    browser: Browser, ground: Ground, action: dict[str, Any], status: int, told: str
) -> None:
    """And the alarm stays as it was."""
    answer = await act(browser, **action)
    assert answer.status == status
    assert answer.json()["error"].startswith(told)
    (alarm,) = ground.journal.reports("kapvik", START_NS + HOUR_NS)
    assert alarm.state == "unacknowledged"


async def test_a_table_is_downloaded_in_both_formats(browser: Browser) -> None:
    """Under the rover's and the table's name, for the range that is shown."""
    query = f"?from={START_MS + 10_000}&to={START_MS + 19_500}"
    text = await browser.get(f"/download/kapvik/snapshot.csv{query}")
    assert text.headers["content-disposition"] == 'attachment; filename="kapvik-snapshot.csv"'
    assert text.headers["content-type"] == "text/csv; charset=utf-8"
    rows = list(csv.DictReader(io.StringIO(text.body.decode())))
    assert [row["sequence"] for row in rows] == [str(number) for number in range(10, 20)]
    columns = await browser.get(f"/download/kapvik/snapshot.parquet{query}")
    assert 'filename="kapvik-snapshot.parquet"' in columns.headers["content-disposition"]
    assert pq.read_table(io.BytesIO(columns.body)).column("sequence").to_pylist() == list(range(10, 20))


@pytest.mark.parametrize("name", ["wheel.csv", "snapshot.xlsx"])
async def test_what_is_no_table_is_told(browser: Browser, name: str) -> None:
    """With what there is."""
    answer = await browser.get(f"/download/kapvik/{name}")
    assert answer.status == 404
    assert answer.json()["error"].startswith("Tables are snapshot, posterior, odometry")


async def test_a_number_that_is_none_is_null(browser: Browser, ground: Ground) -> None:
    """JSON has no NaN: a browser could not read it."""
    ground.live.health["kapvik"] = {"worst_late_ms": float("nan")}
    answer = await browser.get("/api/state")
    assert json.loads(answer.body, parse_constant=pytest.fail)["rovers"]["kapvik"]["latest"]["health"] == {
        "worst_late_ms": None
    }
