"""A rover's report as the ground shows it: only a readable one, in a page that can run nothing."""

from __future__ import annotations

import gzip
import json
from base64 import b64encode
from typing import TYPE_CHECKING

import pytest
from asgi_client import Browser
from ground_messages import EXAMPLES, received
from starlette.applications import Starlette

from regolithd.daemon.ground.store.messages import MessageStore
from regolithd.daemon.ground.web import reports
from regolithd.daemon.ground.web.reports import ReportPages, html

if TYPE_CHECKING:
    import sqlite3
    from pathlib import Path

PAGE = "<!doctype html><title>Report</title>" + "x" * 1000


def packed(page: str) -> str:
    """Return a page as the message has it."""
    return b64encode(gzip.compress(page.encode())).decode()


@pytest.fixture
def browser(writer: sqlite3.Connection, tmp_path: Path) -> Browser:
    """A browser at the store's reports, of which two rovers have one, and one rover a damaged one."""
    store = MessageStore(writer)
    assert "report" in EXAMPLES
    list(
        store.add(
            [
                received("report", 1, rover="red", html_gzip=packed("old")),
                received("report", 2, rover="red", html_gzip=packed(PAGE)),
                received("report", 1, rover="blue", html_gzip=packed("blue")),
                received("report", 1, rover="green", html_gzip="not base64!"),
                received("report", 1, rover="grey", html_gzip=b64encode(b"not gzip").decode()),
            ]
        )
    )
    return Browser(Starlette(routes=ReportPages(tmp_path / "ground.sqlite").routes))


async def test_the_newest_report_of_a_rover_is_shown(browser: Browser) -> None:
    """Nothing in it runs, and it loads nothing: it comes from a rover."""
    answer = await browser.get("/report/red")
    assert (answer.status, answer.body.decode()) == (200, PAGE)
    assert answer.headers["content-type"].startswith("text/html")
    policy = answer.headers["content-security-policy"]
    assert policy == "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox"
    assert (await browser.get("/report/blue")).body == b"blue"


@pytest.mark.parametrize("rover", ["green", "grey", "absent"])
async def test_a_rover_without_a_readable_report_has_none(browser: Browser, rover: str) -> None:
    """Damaged is as good as absent."""
    answer = await browser.get(f"/report/{rover}")
    assert answer.status == 404
    assert b"readable report" in answer.body


def test_a_page_is_cut_off_at_its_largest_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """A small message may hold a page that fills the memory."""
    monkeypatch.setattr(reports, "LARGEST", 100)
    assert len(html(json.dumps({"html_gzip": packed(PAGE)}).encode())) == 100
