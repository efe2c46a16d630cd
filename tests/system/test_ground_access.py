"""Who may use the ground's page: login with a password in Chromium, and requests of other web sites."""

from __future__ import annotations

import signal
from typing import TYPE_CHECKING

import pytest
from ground_rig import GroundRig
from playwright.sync_api import expect

from regolithd.daemon.ground.web.users import add_user

if TYPE_CHECKING:
    from pathlib import Path

    from broker import Mosquitto
    from playwright.sync_api import Browser

pytestmark = pytest.mark.timeout(180)


def test_with_users_a_password_is_needed(browser: Browser, tmp_path: Path, mosquitto: Mosquitto) -> None:
    """Nothing is shown or done without login; a wrong password is refused; actions carry the login's name."""
    rig = GroundRig(tmp_path, mosquitto, page='users = "users"')
    add_user(tmp_path / "users", "ada", "difference engine")
    try:
        rig.start_ground()
        rig.publish("alarm/bus", "alarm", rover="kapvik", name="bus", severity="critical", active=True, sequence=1)
        status, answer = rig.post("/api/alarms/kapvik/bus", {"action": "acknowledged", "who": "Eve"})
        assert (status, answer["error"]) == (401, "You are not logged in.")
        page = browser.new_page()
        page.goto(rig.url)
        page.get_by_label("Name").fill("ada")
        page.get_by_label("Password").fill("analytical engine")
        page.get_by_role("button", name="Log in").click()
        expect(page.get_by_role("alert")).to_have_text("Name or password is wrong.")
        page.get_by_label("Password").fill("difference engine")
        page.get_by_role("button", name="Log in").click()
        page.get_by_role("button", name="Acknowledge: bus").click()
        expect(page.locator('[data-alarm="bus"]')).to_contain_text("by ada")
        rig.stop("ground", signal.SIGKILL)
        rig.start_ground()
        page.reload()
        expect(page.locator("#user")).to_have_text("ada")
        page.get_by_role("button", name="Log out").click()
        expect(page.get_by_label("Password")).to_be_visible()
        assert "difference" not in (tmp_path / "users").read_text()
        page.close()
        for _ in range(5):
            status, answer = rig.post("/login", {"name": "ada", "password": "guess"})
        assert status == 401
        assert rig.post("/login", {"name": "ada", "password": "difference engine"})[0] == 429
    finally:
        rig.end()


def test_other_web_sites_are_refused(tmp_path: Path, mosquitto: Mosquitto) -> None:
    """A request that another page makes, or that names another host, is refused; so is a second ground on the store."""
    rig = GroundRig(tmp_path, mosquitto)
    try:
        rig.start_ground()
        assert (
            rig.post("/api/alarms/a/b", {"action": "acknowledged", "who": "E"}, Origin="http://evil.example")[0] == 403
        )
        assert rig.post("/api/alarms/a/b", {"action": "acknowledged", "who": "E"}, Host="evil.example")[0] == 421
        assert rig.post("/api/alarms/a/b", {"action": "acknowledged", "who": "E"})[0] == 409
        rig.spawn("second", "-m", "regolithd", "ground", "--config", "ground.toml")
        assert rig.processes["second"].wait(30) == 1
        assert "another program uses it" in rig.output("second")
    finally:
        rig.end()
