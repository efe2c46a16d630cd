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
"""Bootstrap samples of the trials, for the interval of a median."""


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
        low, high = np.quantile(own, (0.25, 0.75))
        figures |= {f"{key}_margin_median": float(np.median(own))}
        figures |= {f"{key}_margin_lower_quartile": float(low), f"{key}_margin_upper_quartile": float(high)}
    for other in CHOICES[1:]:
        figures |= against(driven, other)
    return figures


def margins(trials: Sequence[Trial], choice: Choice) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the margin of each trial after the experiment of one choice."""
    return np.array([trial.results[choice].margin for trial in trials], np.float64)


def against(trials: Sequence[Trial], other: Choice) -> dict[str, float]:
    """Return how often the proposed experiment has the larger margin (Clopper and Pearson), and by how much it has.

    That is the median of the differences, with an interval of a bootstrap over the trials: margins may be negative, so
    that they have no ratio. Equal margins are no win for either.
    """
    ours, theirs = margins(trials, "proposed"), margins(trials, other)
    wins, ties = int(np.sum(ours > theirs)), int(np.sum(ours == theirs))
    decided = len(trials) - ties
    low, high = binomtest(wins, decided).proportion_ci(CONFIDENCE) if decided else (0.0, 1.0)
    rng = np.random.default_rng(1)
    drawn = np.median((ours - theirs)[rng.integers(len(trials), size=(DRAWS, len(trials)))], axis=1)
    key = other.replace("-", "_")
    return {
        f"wins_against_{key}": wins,
        f"ties_with_{key}": ties,
        f"win_share_against_{key}": wins / decided if decided else 0.5,
        f"win_share_against_{key}_low": float(low),
        f"win_share_against_{key}_high": float(high),
        f"ahead_of_{key}": float(np.median(ours - theirs)),
        f"ahead_of_{key}_low": float(np.quantile(drawn, (1 - CONFIDENCE) / 2)),
        f"ahead_of_{key}_high": float(np.quantile(drawn, (1 + CONFIDENCE) / 2)),
    }
