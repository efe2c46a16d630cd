"""The study from the command line: figures as JSON, a table, and a picture."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.online.thresholds import ONLINE_THRESHOLDS
from regolithd.calibration.validation.online_study.drives import sound_drive
from regolithd.calibration.validation.online_study.measured import Delay, Offline, alarm_for, delay_of, highest, offline
from regolithd.calibration.validation.online_study.picture import picture

if TYPE_CHECKING:
    from collections.abc import Sequence

SOUND_SEED, DRAG_SEED = 20261122, 31415926
SOUND_S, DRAG_S = 7200.0, 3600.0
SHARES = (0.1, 0.2, 0.3, 0.5, 1.0)
"""Sizes of the drag, as shares of the mean current."""


def main() -> None:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(prog="regolithd.calibration.validation.online_study")
    parser.add_argument("figures", type=Path)
    parser.add_argument("drawing", type=Path)
    parser.add_argument("--drives", type=int, default=10, help="sound drives of two hours (10)")
    parser.add_argument("--draws", type=int, default=10, help="draws of the noise for each (10)")
    parser.add_argument("--drags", type=int, default=10, help="drives with drag, at each size (10)")
    parser.add_argument("--offline", type=int, default=3, help="of these compared offline as well (3)")
    asked = parser.parse_args()
    flat = sound(asked.drives, asked.draws) if asked.drives else {}
    flat |= drags(asked.drags, asked.offline, asked.drawing) if asked.drags else {}
    known = {name: value for name, value in flat.items() if np.isfinite(value)}
    asked.figures.parent.mkdir(parents=True, exist_ok=True)
    asked.figures.write_text(json.dumps(known, indent=1) + "\n")


def tell(words: str) -> None:
    """Print a line at once."""
    print(words, flush=True)  # noqa: T201  # a command line


def sound(drives: int, draws: int) -> dict[str, float]:
    """Measure the rate of false reports."""
    limits = ONLINE_THRESHOLDS
    largest: list[float] = []
    for number in range(drives):
        drive = sound_drive(SOUND_SEED, number, SOUND_S, limits)
        largest += highest(drive, np.random.default_rng([SOUND_SEED, number, 1]), draws, limits)
        told = ", ".join(f"{value:.1f}" for value in largest[-draws:])
        tell(f"sound drive {number + 1} of {drives}: largest statistics {told}")
    hours = (SOUND_S / limits.interval_s - limits.learning_intervals) * limits.interval_s / 3600
    found, error = alarm_for(np.array(largest), hours)
    above = sum(value > limits.alarm for value in largest)
    tell(f"{len(largest) * hours:.0f} h of sound driving: {above} of {len(largest)} drives above {limits.alarm}")
    tell(f"threshold for one false report in 100 h: {found:.1f} ± {error:.1f}")
    return {
        "sound_hours": len(largest) * hours,
        "sound_drives": len(largest),
        "false_reports": above,
        "alarm_in_use": limits.alarm,
        "alarm_for_100_h": found,
        "alarm_standard_error": error,
        **{f"largest_{q}": float(np.quantile(largest, q / 100)) for q in (50, 75, 90, 95, 99)},
    }


def drags(count: int, also_offline: int, drawing: Path) -> dict[str, float]:
    """Measure the delays of reports, beside the answers of the whole recordings."""
    limits = ONLINE_THRESHOLDS
    flat: dict[str, float] = {}
    delays: list[Delay] = []
    answers: list[Offline] = []
    for number in range(count):
        drive = sound_drive(DRAG_SEED, number, DRAG_S, limits)
        rng = np.random.default_rng([DRAG_SEED, number, 1])
        wheel, onset_s = int(rng.integers(1, 7)), float(rng.uniform(0.4, 0.6)) * DRAG_S
        delays += [delay_of(drive, wheel, share, onset_s, limits) for share in SHARES]
        if number < also_offline:
            answers += [offline(drive, wheel, share, onset_s) for share in SHARES]
        tell(f"drive {number + 1} of {count} with drag")
    for share in SHARES:
        row = _row([each for each in delays if each.share == share], [each for each in answers if each.share == share])
        tell(
            f"drag of {100 * share:.0f} % of the mean current on one wheel: "
            + ", ".join(f"{k} {v:.3g}" for k, v in row.items())
        )
        flat |= {f"drag_{100 * share:.0f}_{key}": value for key, value in row.items()}
    drawing.write_text(picture(delays, SHARES) + "\n")
    return flat


def _row(delays: Sequence[Delay], answers: Sequence[Offline]) -> dict[str, float]:
    """Return the figures of one size; a delay beyond the end of the drive counts as infinite."""
    times = np.array([np.inf if each.delay_s is None else each.delay_s / 60 for each in delays])
    reported = np.isfinite(times)
    errors = [each.onset_error_s for each in answers if each.onset_error_s is not None]
    return {
        "drives": len(delays),
        "reported": float(reported.sum()),
        "right_wheel": float(sum(each.named for each in delays)),
        "delay_median_min": float(np.quantile(times, 0.5, method="higher")),
        "delay_90_min": float(np.quantile(times, 0.9, method="higher")),
        "bound_median_min": float(np.median([each.bound_s / 60 for each in delays])),
        "offline_drives": len(answers),
        "offline_right": float(sum(each.found for each in answers)),
        "offline_onset_error_median_s": float(np.median(errors)) if errors else float("nan"),
    }


if __name__ == "__main__":
    main()
