"""How often each choice leads to the right name, and by how much the proposed one is ahead of the others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import binomtest

from regolithd.calibration.validation.experiment_study.choices import CHOICES, Choice

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.validation.experiment_study.trials import Trial

CONFIDENCE = 0.9
DRAWS = 2000
"""Bootstrap samples of the trials, for the interval of a ratio."""


def figures_of(trials: Sequence[Trial]) -> dict[str, float]:
    """Return the figures as one flat object; `trials` with an experiment count, the others are told."""
    driven = [trial for trial in trials if trial.results]
    figures: dict[str, float] = {"trials": len(trials), "driven": len(driven)}
    if not driven:
        return figures
    for choice in CHOICES:
        key, own = choice.replace("-", "_"), margins(driven, choice)
        right = sum(trial.results[choice].right for trial in driven)
        figures |= {f"{key}_right": right, f"{key}_right_share": right / len(driven)}
        figures |= {f"{key}_margin_median": float(np.median(own)), f"{key}_margin_mean": float(np.mean(own))}
    for other in CHOICES[1:]:
        figures |= against(driven, other)
    return figures


def margins(trials: Sequence[Trial], choice: Choice) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the margin of each trial after the experiment of one choice."""
    return np.array([trial.results[choice].margin for trial in trials], np.float64)


def against(trials: Sequence[Trial], other: Choice) -> dict[str, float]:
    """Return how often the proposed experiment has the larger margin (Clopper and Pearson), and the ratio of means.

    The ratio's interval is of a bootstrap over the trials. Trials in which both drives are the same are half a win.
    """
    ours, theirs = margins(trials, "proposed"), margins(trials, other)
    wins, ties = int(np.sum(ours > theirs)), int(np.sum(ours == theirs))
    decided = len(trials) - ties
    low, high = binomtest(wins, decided).proportion_ci(CONFIDENCE) if decided else (0.0, 1.0)
    rng = np.random.default_rng(1)
    picked = rng.integers(len(trials), size=(DRAWS, len(trials)))
    # A mean margin that is not positive gives no ratio: wrong answers are ahead there.
    means = np.maximum(theirs[picked].mean(axis=1), 1e-9)
    drawn = ours[picked].mean(axis=1) / means
    key = other.replace("-", "_")
    return {
        f"wins_against_{key}": wins,
        f"ties_with_{key}": ties,
        f"win_share_against_{key}": wins / decided if decided else 0.5,
        f"win_share_against_{key}_low": float(low),
        f"win_share_against_{key}_high": float(high),
        f"ratio_to_{key}": float(ours.mean() / max(float(theirs.mean()), 1e-9)),
        f"ratio_to_{key}_low": float(np.quantile(drawn, (1 - CONFIDENCE) / 2)),
        f"ratio_to_{key}_high": float(np.quantile(drawn, (1 + CONFIDENCE) / 2)),
    }
