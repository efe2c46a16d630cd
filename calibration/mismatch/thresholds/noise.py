"""The noise, and the blocks of time over which it is independent."""

from __future__ import annotations

from dataclasses import dataclass

from regolithd.calibration.mismatch.thresholds.threshold import CHOICE, TRIALS, threshold


@dataclass(frozen=True)
class NoiseThresholds:
    """The noise, and the blocks of time over which it is independent."""

    # Noise
    lag_significance: float = threshold(
        2.0,
        "Standard errors below which an autocorrelation ends the sum over lags.",
        "standard: a two-sided 95 % test of one correlation; the truncation follows Geyer (1992), initial sequence",
    )
    longest_lag_share: float = threshold(
        0.1,
        "Largest lag of the autocorrelation, as a share of the recording.",
        f"{CHOICE}: each lag is then a mean over at least nine tenths of the readings",
    )
    provisional_autocorrelation_time: float = threshold(
        5.0,
        "Longest autocorrelation time [readings] assumed while the noise is not known yet.",
        f"{TRIALS}: a missing effect lengthens the first estimate; with that estimate the effect is not seen",
    )
    provisional_terms: int = threshold(
        4,
        "Terms taken out of the residual before the noise is first estimated, significant or not.",
        f"{CHOICE}: twice the largest number of effects in a trial; their few coefficients hardly lower the estimate",
    )
    noise_term_share: float = threshold(
        0.4,
        "Share of `smooth_term_entry` that a term must score to be taken out before the noise is estimated again.",
        f"{TRIALS}: what is left in makes the noise seem larger, what is taken out by chance smaller",
    )
    slowest_noise_share: float = threshold(
        0.02,
        "Correlation time of the noise, as a share of the recording, up to which it is usual.",
        f"{CHOICE}: fifty of these times; slow noise and an effect that is as slow have the same likelihood",
    )
    slowest_possible_noise_share: float = threshold(
        0.05,
        "The same, beyond which what wanders is structure; noise in between is one in ten.",
        f"{CHOICE}: twenty of these times; a wave over half of the recording, as large as the noise, gains 22 beside "
        "it, and 38 beside noise that is usual",
    )
    noise_term_columns: int = threshold(
        12,
        "Most columns of a term that is taken out before the noise is estimated: a freer curve follows noise.",
        f"{CHOICE}: curves over covariates have at most 8, the curve over time 48",
    )
    least_white: float = threshold(
        3.0,
        "White noise, in variances of the noise, that is added before its autoregression is estimated, so that quick "
        "changes are not believed to a precision that no law, time stamp or controlled input has.",
        f"{TRIALS}: with 0.1, laws that are 10 % off left a second effect, and 3 of 45 sound recordings were not "
        "consistent; evidence was up to 2.6 times that of readings as read, with 3 it is 1.1 to 1.8 times",
    )
    # Blocks and folds
    block_autocorrelation_times: float = threshold(
        10.0,
        "Length of a block of time in autocorrelation times of the noise.",
        f"{CHOICE}: the correlation between means of neighbouring blocks is then about 1/20",
    )
    most_blocks: int = threshold(
        90,
        "Blocks of time at most, so that one is long against what the autocorrelation does not show.",
        "standard: a variance from 90 independent values is known to sqrt(2/90) = 15 %, its root to 7 %",
    )
    blocks_per_fold: int = threshold(
        6, "Blocks that each fold should have, if the recording is long enough.", f"{CHOICE}: folds that see all states"
    )
    folds: int = threshold(5, "Folds of the cross-validation.", "standard: five to ten (Hastie et al., 2009, 7.10)")
