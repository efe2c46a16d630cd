"""The ground in Chromium, against mosquitto, the daemon and the virtual rover: what an operator sees and does."""

from __future__ import annotations

import re
import signal
import sqlite3
import time
from contextlib import closing
from itertools import pairwise
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

import pytest
from axe_playwright_python.sync_playwright import Axe
from broker import Mosquitto, mosquitto_program
from ground_rig import GroundRig, until
from playwright.sync_api import expect

from regolithd.daemon.ground.store.series import MOST_POINTS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page, Route

pytestmark = pytest.mark.timeout(180)
PATIENCE_MS = 20_000
PAGE_LOAD_MS = 60_000
"""How long a page may take to load: the first one also waits for Chromium to start, on a busy machine too."""
OUTAGE_S = 30
EVIDENCE = {
    "onset": "2026-11-22T04:00:00.000000000Z",
    "direction": "fall",
    "wheels": [1, 2],
    "torque_ratio": 0.29,
    "statistic": 11.1,
    "threshold": 10.8,
    "cohesion_fell": 0.91,
    "friction_angle_fell": 0.6,
    "drawbar_margin_fell": 0.71,
}


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[GroundRig]:
    """A broker, a ground, and a rover that has driven for some seconds."""
    if mosquitto_program() is None:
        pytest.skip("no broker here: apt-get install mosquitto")
    folder = tmp_path_factory.mktemp("ground")
    settings = f"allow_anonymous true\npersistence true\npersistence_location {folder}/\nmax_queued_messages 10000\n"
    broker = Mosquitto(folder, settings=settings)
    rig = GroundRig(folder, broker)
    try:
        broker.start()
        rig.start_ground()
        rig.start_daemon()
        until(lambda: messages(rig, "posterior") > 8, "the first posteriors are stored")
        yield rig
    finally:
        rig.end()
        broker.stop()


@pytest.fixture
def page(browser: Browser, rig: GroundRig) -> Iterator[Page]:
    """The page of the rover, without an error in the browser's console at its end."""
    page = browser.new_page(viewport={"width": 1500, "height": 1000})
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda line: problems.append(line.text) if line.type == "error" else None)
    page.set_default_timeout(PATIENCE_MS)
    page.set_default_navigation_timeout(PAGE_LOAD_MS)
    page.goto(f"{rig.url}/#kapvik")
    yield page
    page.close()
    assert not [each for each in problems if not re.search(r"ERR_|status of 400", each)]


def messages(rig: GroundRig, topic: str) -> int:
    """Return how many messages of a topic are stored."""
    with closing(sqlite3.connect(rig.database)) as connection:
        query = "SELECT count(*) FROM message JOIN topic ON topic.id = message.topic WHERE topic.name = ?"
        return int(connection.execute(query, (topic,)).fetchone()[0])


def stored_loads(page: Page, rig: GroundRig) -> list[str]:
    """Return the loads of the rover's last snapshot as the page writes them; one that came too late is a dash."""
    loads = rig.get("/api/state")["rovers"]["kapvik"]["latest"]["snapshot"]["load_N"]
    return [page.evaluate("load => load === null ? '–' : load.toFixed(1)", load) for load in loads]


def coloured(page: Page, place: str, to: float = 1.0) -> int:
    """Return how many pixels of a canvas, of its left part `to`, are drawn in a colour (not grey)."""
    script = """(canvas, to) => {
        const {data} = canvas.getContext("2d").getImageData(0, 0, canvas.width * to, canvas.height);
        let count = 0;
        for (let k = 0; k < data.length; k += 4)
            if (data[k + 3] > 40 && Math.abs(data[k] - data[k + 1]) + Math.abs(data[k + 1] - data[k + 2]) > 25) count++;
        return count; }"""
    return int(page.locator(place).first.evaluate(script, to))


def hatched(page: Page) -> int:
    """Return how many pixels of the cohesion's plot are bluish: only the hatching of back-filled spans is."""
    script = """canvas => {
        const {data} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
        let count = 0;
        for (let k = 0; k < data.length; k += 4) if (data[k + 3] > 40 && data[k + 2] > data[k] + 10) count++;
        return count; }"""
    return int(page.locator("#plots .three figure:nth-child(1) canvas").evaluate(script))


def test_the_present_state_is_shown_and_moves(page: Page) -> None:
    """Rover online, age of the data, six wheels with numbers that change, intervals of the soil and the track drawn."""
    expect(page.locator("#presence")).to_contain_text(
        re.compile(r"kapvik: online · data \d\.\d s old"), timeout=PATIENCE_MS
    )
    load = page.locator('[data-wheel="3"] [data-value="load_N"]')
    expect(load).to_have_text(re.compile(r"\d+\.\d"), timeout=PATIENCE_MS)
    first = load.text_content()
    expect(load).not_to_have_text(first or "", timeout=PATIENCE_MS)
    expect(page.locator("#plots figcaption output").first).to_contain_text("kPa (90 %:", timeout=PATIENCE_MS)
    for place in (
        "#plots .three figure:nth-child(1) canvas",
        "#plots .three figure:nth-child(3) canvas",
        "#track canvas",
    ):
        until(lambda place=place: coloured(page, place) > 100, f"{place} is drawn")
    expect(page.locator("#track .legend")).to_contain_text("m driven")
    expect(page.locator("#nodes tbody tr")).to_have_count(14)


def test_an_outage_of_the_broker_is_back_filled_and_marked(page: Page, rig: GroundRig) -> None:
    """Half a minute without the broker: the page says so; then the gap is filled and hatched, nothing stored twice."""
    expect(page.locator("#presence")).to_contain_text("online", timeout=PATIENCE_MS)
    until(lambda: coloured(page, "#plots .three figure:nth-child(1) canvas") > 100, "the cohesion is drawn")
    assert hatched(page) == 0
    begun = time.monotonic()
    rig.broker.stop()
    expect(page.locator("#problem")).to_contain_text("connection refused", timeout=PATIENCE_MS)
    expect(page.locator("#presence")).to_contain_text("unknown: no connection")
    time.sleep(OUTAGE_S - (time.monotonic() - begun))
    rig.broker.start()
    expect(page.locator("#presence")).to_contain_text("online", timeout=2 * PATIENCE_MS)

    def sent() -> tuple[list[float], list[float]]:
        """Return the times of the last two minutes' messages [ms], and those of the late ones, which come in order."""
        now_ms = round(1000 * time.time())
        columns = rig.get(f"/api/history/kapvik?from={now_ms - 120_000}&to={now_ms}")["snapshot"]
        pairs = zip(columns["time_ms"], columns["late"], strict=True)
        return columns["time_ms"], [moment for moment, late in pairs if late]

    until(lambda: (late := sent()[1]) and late[-1] - late[0] > 900 * OUTAGE_S, "the outage is back-filled")
    until(lambda: hatched(page) > 100, "the back-filled span is hatched")
    moments, late = sent()
    assert max(later - earlier for earlier, later in pairwise(moments)) < 1000, "no gap is left"
    assert len(late) < len(moments)
    with closing(sqlite3.connect(rig.database)) as connection:
        ((count, different),) = connection.execute(
            "SELECT count(*), count(DISTINCT sequence) FROM message JOIN topic ON topic.id = topic"
            " WHERE name = 'snapshot'"
        )
    assert count == different


def test_a_message_that_comes_again_changes_nothing(page: Page, rig: GroundRig) -> None:
    """QoS 1 delivers at least once: of messages with the same session and sequence the first counts."""
    begun_ns = time.time_ns() - 2_000_000_000  # no message is later than the range that the page asks for
    for sequence, margin in ((1, 0.25), (2, 0.5), (1, 0.75), (2, 0.75), (3, 0.375)):
        interval = dict.fromkeys(("low_90", "low_50", "median", "high_50", "high_90"), margin)
        moment = begun_ns + 500_000_000 * sequence
        rig.publish("posterior", "posterior", "twice", now_ns=moment, sequence=sequence, drawbar_margin=interval)
    page.locator('[data-rover="twice"]').click()
    expect(page.locator("#plots .three output").nth(2)).to_contain_text("0.375")
    begun_ms = begun_ns // 1_000_000
    history = rig.get(f"/api/history/twice?from={begun_ms}&to={begun_ms + 10_000}")["posterior"]
    assert history["values"]["drawbar_margin_median"] == [0.25, 0.5, 0.375]


def test_an_answer_about_the_rover_before_is_not_shown(page: Page, rig: GroundRig) -> None:
    """A history that arrives after another rover was chosen is dropped."""
    interval = dict.fromkeys(("low_90", "low_50", "median", "high_50", "high_90"), 0.125)
    rig.publish("posterior", "posterior", "other", drawbar_margin=interval)
    other, kapvik = page.locator('[data-rover="other"]'), page.locator('[data-rover="kapvik"]')
    other.click()
    margin = page.locator("#plots .three output").nth(2)
    expect(margin).to_contain_text("0.125")

    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page.route("**/api/history/kapvik*", hold, times=1)
    with page.expect_request("**/api/history/kapvik*"):
        kapvik.click()
    other.click()
    expect(margin).to_contain_text("0.125")
    with page.expect_response("**/api/history/kapvik*"):
        held[0].continue_()
    page.wait_for_timeout(500)
    expect(margin).to_contain_text("0.125")


def test_an_alarm_stays_until_somebody_acknowledges_it(page: Page, rig: GroundRig) -> None:
    """It begins, ends and stays; it is acknowledged with a name only, which stands in the journal."""
    rig.inject_fault("off 13")
    alarm = page.locator('[data-alarm="node-13"]')
    expect(alarm.locator(".state")).to_have_text("active, unacknowledged", timeout=PATIENCE_MS)
    expect(page.locator("#announcement")).to_contain_text("Alarm node-13, error")
    rig.inject_fault("on 13")
    expect(alarm.locator(".state")).to_have_text("cleared, unacknowledged", timeout=PATIENCE_MS)
    expect(alarm).to_contain_text("no heartbeat for")
    alarm.get_by_role("button", name="Acknowledge").press("Enter")
    expect(page.locator("#problem")).to_contain_text("Enter your name first")
    page.locator("#who").fill("Ada")
    alarm.get_by_role("button", name="Acknowledge").press("Enter")
    expect(alarm).to_have_count(0)
    expect(page.locator("#log")).to_contain_text("node-13 acknowledged Ada")
    page.reload()
    expect(page.locator("#log")).to_contain_text("node-13 acknowledged Ada")
    expect(alarm).to_have_count(0)


def test_a_latching_alarm_of_another_rover_shows_its_evidence_and_needs_a_reset(page: Page, rig: GroundRig) -> None:
    """Its end leaves it latched with the evidence as numbers; acknowledged it waits for a reset; it can be shelved."""
    fields: dict[str, Any] = {"name": "soil-change", "severity": "warning", "latching": True, "evidence": EVIDENCE}
    rig.publish("alarm/soil-change", "alarm", **fields, sequence=1, active=True, text="the soil is weaker")
    rig.publish("alarm/soil-change", "alarm", **fields, sequence=2, active=False, text="the soil is weaker")
    page.locator('[data-rover="other"]').click()
    alarm = page.locator('[data-alarm="soil-change"]')
    expect(alarm.locator(".state")).to_have_text("latched, unacknowledged")
    for text in ("04:00:00", "1, 2", "29 %", "11.1, 10.8", "91 %", "60 %", "71 %"):
        expect(alarm.locator(".evidence")).to_contain_text(text)
    page.locator("#who").fill("Grace")
    alarm.get_by_label("Shelve soil-change for").select_option("1 h")
    expect(alarm.locator(".state")).to_have_text("latched, unacknowledged")
    alarm.get_by_role("button", name="Shelve").press("Enter")
    expect(alarm.locator(".state")).to_have_text("shelved")
    expect(alarm).to_contain_text("by Grace")
    alarm.get_by_role("button", name="Unshelve").click()
    alarm.get_by_role("button", name="Acknowledge").click()
    expect(alarm.locator(".state")).to_have_text("latched, acknowledged")
    alarm.get_by_role("button", name="Reset").click()
    expect(alarm).to_have_count(0)


def test_the_last_comparison_is_on_the_page(page: Page, rig: GroundRig) -> None:
    """Verdict, effect, wheels, size with interval and report of the newest comparison."""
    expect(page.locator("#comparison")).to_contain_text("None yet")
    rig.publish("mismatch", "mismatch", rover="kapvik", sequence=0)
    comparison = page.locator("#comparison")
    expect(comparison).to_contain_text("missing-physics The simulation leaves out: viscous-friction.")
    row = comparison.locator("tbody tr")
    for text in ("viscous-friction", "all wheels", "0.000041 A s/rad", "0.000036 to 0.000045"):
        expect(row).to_contain_text(text)
    expect(comparison).to_contain_text("traverse-20130611T140722Z.html")


def test_an_alarm_that_comes_while_the_state_is_read_is_not_lost(browser: Browser, rig: GroundRig) -> None:
    """The answer is older than the update that overtook it: the alarm stays on the page."""
    rig.publish("state", "state", "overtaken", sequence=0)
    until(lambda: "overtaken" in rig.get("/api/state")["rovers"], "the rover is known")
    page = browser.new_page()

    def answer_late(route: Route) -> None:
        answer = route.fetch()
        rig.publish("alarm/bus", "alarm", "overtaken", name="bus", active=True, text="bus-off", sequence=1)
        until(lambda: rig.get("/api/state")["rovers"]["overtaken"]["alarms"], "the alarm is stored")
        time.sleep(2)
        route.fulfill(response=answer)

    page.route("**/api/state", answer_late, times=1)
    with page.expect_response("**/api/state"):
        page.goto(f"{rig.url}/#overtaken")
    page.wait_for_timeout(1000)
    expect(page.locator('[data-alarm="bus"]')).to_be_visible(timeout=PATIENCE_MS)
    page.close()


def test_a_killed_ground_has_lost_nothing_and_the_page_finds_it_again(page: Page, rig: GroundRig) -> None:
    """SIGKILL: the broker keeps what comes meanwhile; history and journal are there, without gap or repetition."""
    expect(page.locator("#presence")).to_contain_text("online", timeout=PATIENCE_MS)
    before = rig.get("/api/log/kapvik")
    rig.stop("ground", signal.SIGKILL)
    expect(page.locator("#problem")).to_contain_text("No connection to the ground's server")
    time.sleep(2)
    rig.start_ground()
    expect(page.locator("#problem")).to_be_hidden(timeout=PATIENCE_MS)
    expect(page.locator("#presence")).to_contain_text("online", timeout=PATIENCE_MS)
    until(
        lambda: len(sequences(rig)) > 0 and sequences(rig) == list(range(len(sequences(rig)))),
        "every snapshot is stored",
    )
    assert rig.get("/api/log/kapvik")[-len(before) :] == before


def complete(numbers: list[int]) -> bool:
    """Return whether numbers count from 0 without gap and repetition."""
    return bool(numbers) and numbers == list(range(len(numbers)))


def sequences(rig: GroundRig) -> list[int]:
    """Return the sequence numbers of all stored snapshots."""
    with closing(sqlite3.connect(rig.database)) as connection:
        rows = connection.execute(
            "SELECT sequence FROM message JOIN topic ON topic.id = topic WHERE name = 'snapshot' ORDER BY sequence"
        )
        return [row[0] for row in rows]


@pytest.mark.parametrize("look", ["light", "dark", "phone"])
def test_the_page_is_accessible(browser: Browser, rig: GroundRig, look: str) -> None:
    """axe-core finds nothing serious, with an alarm shown, and nothing is wider than the phone's screen."""
    rig.publish(
        "alarm/bus", "alarm", rover=look, name="bus", severity="critical", active=True, text="bus-off", sequence=1
    )
    until(lambda: look in rig.get("/api/state")["rovers"], "the rover is known")
    width = 390 if look == "phone" else 1400
    page = browser.new_page(
        viewport={"width": width, "height": 844}, color_scheme="dark" if look == "dark" else "light"
    )
    page.goto(f"{rig.url}/#{look}")
    expect(page.locator('[data-alarm="bus"]')).to_be_visible(timeout=PATIENCE_MS)
    found = Axe().run(page).response["violations"]
    serious = [each for each in found if each["impact"] in {"serious", "critical"}]
    assert [(each["id"], node["target"], node["failureSummary"]) for each in serious for node in each["nodes"]] == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.close()


def test_every_table_can_be_downloaded(rig: GroundRig, page: Page) -> None:
    """The links of the page give CSV and Parquet with the same rows."""
    import io  # noqa: PLC0415  # only here
    import urllib.request  # noqa: PLC0415

    import pandas as pd  # noqa: PLC0415  # slow to import

    expect(page.locator("#downloads a").first).to_be_visible(timeout=PATIENCE_MS)
    for kind in ("snapshot", "posterior", "odometry", "alarm", "event", "node"):
        links = {}
        for form in ("csv", "parquet"):
            link = page.locator(f'#downloads a[aria-label="{kind} as {form}"]').get_attribute("href")
            assert link
            with urllib.request.urlopen(rig.url + link.partition("?")[0] + "?from=0&to=1e15", timeout=20) as answer:
                links[form] = answer.read()
        table = pd.read_csv(io.BytesIO(links["csv"]))
        assert 0 < len(table) <= len(pd.read_parquet(io.BytesIO(links["parquet"])))
        assert (table["time_ms"].diff().dropna() >= 0).all()
    assert "load_N_6" in pd.read_csv(io.BytesIO(links["csv"])).columns or kind == "node"


def test_an_hour_is_drawn_from_means_while_data_arrive(rig: GroundRig, browser: Browser) -> None:
    """A range of one hour has at most `MOST_POINTS` points, is drawn from its beginning, and new messages are shown."""
    with closing(sqlite3.connect(rig.database, timeout=20)) as connection:
        fill_hour(connection)
    page = browser.new_page(viewport={"width": 1500, "height": 1000})
    page.goto(f"{rig.url}/#kapvik")
    expect(page.locator("#presence")).to_contain_text("online", timeout=PATIENCE_MS)
    with page.expect_response(lambda answer: asked_s(answer.url) == 3600) as waiting:
        page.locator("#span").select_option("1 h")
    points = waiting.value.json()["snapshot"]
    assert points["spacing_s"] > 0 < len(points["time_ms"]) <= MOST_POINTS
    until(lambda: coloured(page, "#plots .figures:not(.three) canvas", to=0.3) > 100, "the hour's beginning is drawn")
    shown = page.locator('[data-wheel="3"] [data-value="load_N"]')
    expect(shown).not_to_have_text(shown.text_content() or "", timeout=PATIENCE_MS)
    page.close()


def asked_s(url: str) -> float:
    """Return the range of time that a page asks for [s]; 0 where it asks for none."""
    asked = parse_qs(urlsplit(url).query)
    return round((float(asked["to"][0]) - float(asked["from"][0])) / 1000) if "to" in asked else 0.0


def fill_hour(connection: sqlite3.Connection) -> None:
    """Copy the means of some minutes over the hour before: as many points as an hour has."""
    rows = connection.execute("SELECT * FROM bucket WHERE span_s = 2 ORDER BY start_s").fetchall()
    first = rows[0][3]
    copies = [
        (*row[:3], row[3] - shift, *row[4:]) for row in rows for shift in range(60, 3600, 60) if row[3] < first + 60
    ]
    connection.executemany("INSERT OR IGNORE INTO bucket VALUES (?, ?, ?, ?, ?, ?, ?)", copies)
    connection.commit()


def test_a_rover_that_ends_is_offline_and_grey(page: Page, rig: GroundRig) -> None:
    """After its end the rover is offline with the reason, and what is shown of it is marked as last known."""
    expect(page.locator("#presence")).to_contain_text("online", timeout=PATIENCE_MS)
    assert rig.stop("daemon") == 0
    expect(page.locator("#presence")).to_contain_text(re.compile(r"offline since \d\d:\d\d:\d\d \(stopped\)"))
    assert "offline" in (page.locator("#rover").get_attribute("class") or "")
    assert "grayscale(1)" in page.locator("#wheels .content").evaluate("e => getComputedStyle(e).filter")
    shown = page.locator('[data-wheel] [data-value="load_N"]')
    until(lambda: shown.all_inner_texts() == stored_loads(page, rig), "the loads are those of the last snapshot")
    page.reload()
    expect(page.locator("#presence")).to_contain_text("offline")
    page.locator("#span").select_option("30 min")  # of which the wheels turned at the beginning
    until(lambda: coloured(page, "#track canvas") > 100, "the track is still there")
