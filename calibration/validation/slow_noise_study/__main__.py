"""The study from the command line: a table, and figures as JSON."""

from __future__ import annotations

import argparse
import json
from collections import Counter
from pathlib import Path

from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.validation.slow_noise_study.axis import EFFECTS, NAMES, Axis, recording

CORRELATION_S = (2.0, 5.0, 10.0)
"""Correlation times of the slow noise, of which a recording has 250, 100 and 50."""
BESIDE_EFFECTS_S = 2.0
"""The one beside effects."""


def main() -> None:
    """Compare all recordings."""
    parser = argparse.ArgumentParser(prog="regolithd.calibration.validation.slow_noise_study")
    parser.add_argument("figures", type=Path)
    parser.add_argument("--seed", type=int, default=0, help="of the first recording (0)")
    parser.add_argument("--count", type=int, default=20, help="recordings of each kind (20)")
    asked = parser.parse_args()
    seeds = range(asked.seed, asked.seed + asked.count)
    flat: dict[str, int] = {}
    for correlation_s in CORRELATION_S:
        told = Counter(told_of(seed, correlation_s) for seed in seeds)
        flat[f"nothing_{correlation_s:g}_s_consistent"] = told["consistent"]
        tell(f"nothing concealed, noise correlated over {correlation_s:g} s: {_words(told)}")
    for effect in EFFECTS:
        told = Counter(told_of(seed, BESIDE_EFFECTS_S, effect) for seed in seeds)
        right = NAMES.get(effect, "unexplained")
        flat[f"{effect.replace(' ', '_')}_right"] = told[right]
        tell(f"{effect}, noise correlated over {BESIDE_EFFECTS_S:g} s: {told[right]} right ({_words(told)})")
    flat["recordings_of_each"] = asked.count
    asked.figures.parent.mkdir(parents=True, exist_ok=True)
    asked.figures.write_text(json.dumps(flat, indent=1) + "\n")


def told_of(seed: int, correlation_s: float, effect: str = "") -> str:
    """Return what is told of a recording: names, "unexplained", or "consistent"."""
    answer = compare(recording(seed, correlation_s, effect), Axis()).answer
    names = sorted(each.name for each in answer.effects)
    return " + ".join(names + ["unexplained"] * bool(answer.unexplained)) or answer.verdict


def tell(words: str) -> None:
    """Print a line at once."""
    print(words, flush=True)  # noqa: T201  # a command line


def _words(told: Counter[str]) -> str:
    return ", ".join(f"{count} {what}" for what, count in told.most_common())


if __name__ == "__main__":
    main()
