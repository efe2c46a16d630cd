"""The README's first figure: the head of a real report, photographed by Chromium.

    python -m regolithd.calibration.validation.blind_trials.picture docs/mismatch-report.png build/picture

One recording conceals a worn bearing on one wheel and a gearbox that stiffens in the cold; `regolithd mismatch`
answers; the page that it writes is the figure. The folder keeps the recording, the answer and the whole report.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from regolithd.calibration.validation.blind_trials.errors import ProofError
from regolithd.calibration.validation.blind_trials.files import write_trial
from regolithd.calibration.validation.blind_trials.generator import Plan, make_trial

CONCEALED = Plan(5, 20, "pair", ("bearing-drag", "cold-lubricant-friction"))
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
SIZE = "1000,1120"


def photograph(page: Path, picture: Path) -> None:
    """Photograph the head of a page, twice as fine as it is shown."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        raise ProofError("no browser to photograph with: install chromium")
    command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]
    command += [f"--window-size={SIZE}", "--force-device-scale-factor=1.5", f"--screenshot={picture.resolve()}"]
    subprocess.run([*command, page.resolve().as_uri()], check=True, capture_output=True)  # noqa: S603  # our own page


def main(picture: Path, folder: Path) -> None:
    """Make the recording, let it be answered, photograph the answer."""
    write_trial(make_trial(CONCEALED), folder)
    command = [sys.executable, "-m", "regolithd", "mismatch", str(folder / "recording.csv.gz")]
    report = folder / "report.html"
    options = ["--simulation", str(folder / "SIM.toml"), "--json", str(folder / "answer.json"), "--report", str(report)]
    subprocess.run([*command, *options], check=True)  # noqa: S603  # our own command
    picture.parent.mkdir(parents=True, exist_ok=True)
    photograph(report, picture)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
