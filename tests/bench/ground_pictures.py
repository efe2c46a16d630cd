"""Pictures of the ground page: a virtual rover drives from medium soil into sand, with an outage of the broker before.

    python tests/bench/ground_pictures.py FOLDER

Then, for ground-mismatch.png, three traverses with a drag that `rover.toml` does not know, as in
`tests/system/test_compared_traverses.py`. Writes ground-light.png, -dark.png, -phone.png and -mismatch.png; takes five
minutes.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from broker import Mosquitto
from ground_rig import GroundRig, chromium, until
from playwright.sync_api import Browser, sync_playwright
from recorded_traverse import HOUR_NS, daemon, drive_traverse

from regolithd.daemon.closed_loop.simulated_drive import START_NS

SCENARIO = """
[[ground.stretches]]
soil = "medium-soil"
until_m = 6.5
[[ground.stretches]]
soil = "lete-sand"
"""
COMPARE = (sys.executable, "-m", "regolithd", "compare", "--config")
OUTAGE_AFTER_S, OUTAGE_S = 60, 12
AFTER_ALARM_S = 25
OTHERS = "#presence, #wheels, #track, #log, #plots, #nodes, #downloads, [data-alarm^=node]"
"""What the picture of a comparison leaves out: the daemon that publishes it has no nodes."""
LOOKS = {
    "light": {"viewport": {"width": 1400, "height": 1120}},
    "dark": {"viewport": {"width": 1400, "height": 1120}, "color_scheme": "dark"},
    "phone": {"viewport": {"width": 390, "height": 844}, "device_scale_factor": 2, "is_mobile": True},
}


def drive(rig: GroundRig) -> None:
    """Drive until some time after the alarm."""
    rig.broker.start()
    rig.start_ground()
    rig.start_daemon(SCENARIO)
    time.sleep(OUTAGE_AFTER_S)
    rig.broker.stop()
    time.sleep(OUTAGE_S)
    rig.broker.start()
    until(lambda: "soil-change" in str(rig.get("/api/state")["rovers"]["kapvik"]["alarms"]), "the alarm", 240)
    time.sleep(AFTER_ALARM_S)


def photograph(browser: Browser, rig: GroundRig, folder: Path) -> None:
    """Write the pictures."""
    for name, look in LOOKS.items():
        page = browser.new_page(**look)  # type: ignore[arg-type]
        page.goto(f"{rig.url}/#kapvik")
        page.locator("#who").fill("Ada")
        page.locator("#who").blur()
        page.wait_for_timeout(2500)
        page.screenshot(path=folder / f"ground-{name}.png")
        page.close()


def compare_traverses(folder: Path, port: int) -> None:
    """Drive three traverses and compare each; the second and third with the corrected simulation of the first."""
    for number, drag in enumerate((1.2e-4, 1.2e-4, 2.4e-4)):
        drive_traverse(folder, port, 300.0, drag, 3 + number, START_NS + number * HOUR_NS)
        with daemon(folder):
            subprocess.run([*COMPARE, folder / "rover.toml"], check=True)
        if number == 0:
            (corrected,) = (folder / "recordings/comparisons").glob("*.corrected.toml")
            shutil.copy(corrected, folder / "SIM.toml")


def photograph_comparison(browser: Browser, folder: Path) -> None:
    """Write the picture of alarm and comparison after the third traverse."""
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(temporary)
        rig = GroundRig(place, Mosquitto(place))
        try:
            rig.broker.start()
            rig.start_ground()
            compare_traverses(place, rig.broker.port)
            page = browser.new_page(viewport={"width": 880, "height": 900}, bypass_csp=True)
            page.goto(f"{rig.url}/#kapvik")
            page.add_style_tag(content=f"{OTHERS} {{ display: none !important }}")
            page.locator("#comparison tbody tr").wait_for()
            page.locator("#rover").screenshot(path=folder / "ground-mismatch.png")
            page.close()
        finally:
            rig.end()
            rig.broker.stop()


def main(folder: Path) -> None:
    """Drive and photograph."""
    with tempfile.TemporaryDirectory() as temporary, sync_playwright() as playwright:
        place = Path(temporary)
        settings = f"allow_anonymous true\npersistence true\npersistence_location {place}/\nmax_queued_messages 10000\n"
        rig = GroundRig(place, Mosquitto(place, settings=settings))
        try:
            drive(rig)
            browser = playwright.chromium.launch(executable_path=chromium(), args=["--no-sandbox"])
            photograph(browser, rig, folder)
            photograph_comparison(browser, folder)
        finally:
            rig.end()
            rig.broker.stop()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
