"""A drag that the virtual rover conceals, over three traverses: what is told, and what the operator sees."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import pytest
from broker import mosquitto_program
from ground_rig import GroundRig, until
from playwright.sync_api import expect
from recorded_traverse import HOUR_NS, daemon, drive_traverse

from regolithd.daemon.closed_loop.simulated_drive import START_NS

if TYPE_CHECKING:
    from pathlib import Path

    from broker import Mosquitto
    from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.skipif(mosquitto_program() is None, reason="no broker here: apt-get install mosquitto")
DRAG = 1.2e-4
"""A s/rad at the motor: at a usual speed 45 % of the mean current."""
DURATION_S = 300.0


def traverse_and_compare(rig: GroundRig, number: int, drag: float) -> str:
    """Drive, compare as systemd does after a traverse, and return what the command prints."""
    drive_traverse(rig.folder, rig.broker.port, DURATION_S, drag, 3 + number, START_NS + number * HOUR_NS)
    command = [sys.executable, "-m", "regolithd", "compare", "--config", rig.folder / "rover.toml"]
    with daemon(rig.folder):
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=200)
        until(lambda: done.returncode or is_stored(rig, number), "the ground has the result")
    assert done.returncode == 0, done.stderr
    return " ".join(done.stdout.split())


def is_stored(rig: GroundRig, number: int) -> bool:
    """Return whether the ground has the result of the traverse of this number."""
    rovers = rig.get("/api/state")["rovers"]
    result = rovers.get("kapvik", {"latest": {}})["latest"].get("mismatch")
    stamp = time.strftime("%Y%m%dT%H%M", time.gmtime(START_NS // 1e9 + number * 3600 + 10))
    return result is not None and stamp in result["recording"]


def accept_corrected(folder: Path) -> None:
    """Take the corrected simulation of the last comparison as SIM.toml, as its output says."""
    newest = max((folder / "recordings/comparisons").glob("*.corrected.toml"))
    shutil.copy(newest, folder / "SIM.toml")


def acknowledge(page: Page) -> None:
    """Acknowledge the alarm."""
    page.locator("#who").fill("Ada")
    page.get_by_role("button", name="Acknowledge: mismatch").click()
    expect(page.locator('[data-alarm="mismatch"] .state')).to_have_text("active, acknowledged")


@pytest.mark.timeout(400)
def test_a_concealed_drag_is_found_then_quiet_once_corrected_and_heard_again_when_doubled(
    browser: Browser, tmp_path: Path, mosquitto: Mosquitto
) -> None:
    """Effect, report and alarm stand on the page; the alarm ends when corrected, and returns when doubled."""
    rig = GroundRig(tmp_path, mosquitto)
    try:
        rig.start_ground()
        told = traverse_and_compare(rig, 0, DRAG)
        assert "viscous-friction: Drag that grows with speed, on all 6 wheels" in told
        until(lambda: "kapvik" in rig.get("/api/state")["rovers"], "the rover is known")
        page = browser.new_page(viewport={"width": 1400, "height": 1000})
        page.goto(f"{rig.url}/#kapvik")
        alarm, comparison = page.locator('[data-alarm="mismatch"]'), page.locator("#comparison")
        expect(alarm.locator(".state")).to_have_text("active, unacknowledged")
        expect(alarm).to_contain_text("The simulation leaves out: viscous-friction.")
        expect(comparison.locator("tbody tr")).to_contain_text(["viscous-friction all wheels"], use_inner_text=True)
        report_is_shown(page)
        acknowledge(page)

        accept_corrected(tmp_path)
        assert traverse_and_compare(rig, 1, DRAG).startswith("consistent")
        expect(comparison).to_contain_text("consistent The simulation agrees with the traverse.")
        expect(alarm).to_have_count(0)

        told = traverse_and_compare(rig, 2, 2 * DRAG)
        assert "viscous-friction is larger than the corrected simulation has it" in told
        expect(alarm.locator(".state")).to_have_text("active, unacknowledged")
        expect(alarm).to_contain_text("Changed since the simulation was corrected: viscous-friction.")
        low, high = changed_interval(rig)
        assert low < high
    finally:
        rig.end()


def report_is_shown(page: Page) -> None:
    """Follow the link to the report."""
    with page.expect_popup() as opened:
        page.locator("#comparison a").click()
    expect(opened.value.locator("h1")).to_contain_text("The simulation leaves out viscous friction.")
    opened.value.close()


def changed_interval(rig: GroundRig) -> tuple[float, float]:
    """Return the published interval of the changed effect."""
    (change,) = rig.get("/api/state")["rovers"]["kapvik"]["latest"]["mismatch"]["changes"]
    return change["low"], change["high"]
