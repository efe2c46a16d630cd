"""The README's first figure: the top of a report, as a screenshot by Chromium.

    module=regolithd.calibration.validation.blind_trials.figures.report_screenshot
    python -m $module docs/pictures/mismatch-report.png build/picture

A generated recording conceals a worn bearing on one wheel and cold lubricant; `regolithd mismatch` writes the report.
The folder keeps the recording, the answer and the whole report.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from regolithd.calibration.validation.blind_trials.errors import ProofError
from regolithd.calibration.validation.blind_trials.recordings.files import write_trial
from regolithd.calibration.validation.blind_trials.recordings.generator import Plan, make_trial

PLAN = Plan(5, 20, "pair", ("bearing-drag", "cold-lubricant-friction"))
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
SIZE = "1000,1120"


def screenshot(page: Path, picture: Path) -> None:
    """Write a screenshot of the top of a page, at 1.5 times its size."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        raise ProofError("no browser for the screenshot: install chromium")
    command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]
    command += [f"--window-size={SIZE}", "--force-device-scale-factor=1.5", f"--screenshot={picture.resolve()}"]
    subprocess.run([*command, page.resolve().as_uri()], check=True, capture_output=True)  # noqa: S603  # a page written here


def main(picture: Path, folder: Path) -> None:
    """Generate the recording, run the comparison, write the screenshot of its report."""
    write_trial(make_trial(PLAN), folder)
    command = [sys.executable, "-m", "regolithd", "mismatch", str(folder / "recording.csv.gz")]
    report = folder / "report.html"
    options = ["--simulation", str(folder / "SIM.toml"), "--json", str(folder / "answer.json"), "--report", str(report)]
    subprocess.run([*command, *options], check=True)  # noqa: S603  # a command of this package
    picture.parent.mkdir(parents=True, exist_ok=True)
    screenshot(report, picture)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
