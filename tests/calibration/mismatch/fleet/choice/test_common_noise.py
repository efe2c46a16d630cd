"""How long the noise of a fleet's recordings lasts is told by all of them together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sample_answer import FINDINGS
from synthetic_fleet import DEVIATION, drive

from regolithd.calibration.mismatch.fleet.choice.common_noise import with_common_noise
from regolithd.calibration.mismatch.fleet.work.found import Found
from regolithd.calibration.mismatch.signal.noise_models.noise import NoiseModel, estimate_noise, lagged_sums
from regolithd.calibration.mismatch.signal.noise_models.recursion import recursion

LASTING = 10.0
"""Readings after which slow noise has fallen to 1/e."""


def noise(seed: int, *, slow: bool) -> np.ndarray:
    """Return noise of two wheels, white or first-order autoregressive, shape (time, wheel)."""
    rng, kept = np.random.default_rng(seed), np.exp(-1 / LASTING) if slow else 0.0
    return recursion(np.full((600, 1), kept), rng.normal(size=(600, 2)) * np.sqrt(1 - kept**2))


def found(values: np.ndarray, step_s: float = 1.0) -> Found:
    """Return what a recording shows whose residual is this."""
    known = np.ones(values.shape, np.bool_)
    model = estimate_noise(values, known)
    return Found(
        FINDINGS,
        {},
        model.deviation,
        model.autocorrelation_times,
        0.1,
        8.0,
        (),
        {},
        step_s=step_s,
        lagged=lagged_sums(values, known, NoiseModel(model.deviation, 1.0)),
    )


def test_no_recording_counts_for_more_than_all_say_of_the_noise() -> None:
    """One whose autocorrelation time was told as 1 by chance has the weight of the others."""
    recordings = [found(noise(seed, slow=True)) for seed in range(8)]
    recordings[0] = replace(recordings[0], autocorrelation_times=1.0)
    sums = [drive(seed).sums() for seed in range(8)]
    weighted = with_common_noise(sums, recordings)
    times = [
        float(np.mean(each.autocorrelation_times) * before.weights[0] / after.weights[0])
        for each, before, after in zip(recordings, sums, weighted, strict=True)
    ]
    true = 1 + 2 * np.exp(-1 / LASTING) / (1 - np.exp(-1 / LASTING))
    assert times[0] == pytest.approx(true, rel=0.3)
    assert min(times) > 0.7 * true
    assert np.allclose(weighted[0].blocks / sums[0].blocks, weighted[0].weights[0] / sums[0].weights[0])


def test_white_noise_stays_as_it_is() -> None:
    """Within a few percent of its weight."""
    recordings = [found(noise(seed, slow=False)) for seed in range(8)]
    sums = [drive(seed).sums() for seed in range(8)]
    for before, after in zip(sums, with_common_noise(sums, recordings), strict=True):
        assert after.weights == pytest.approx(before.weights, rel=0.05)


def test_one_recording_and_one_of_another_step_are_judged_alone() -> None:
    """Times in readings are comparable at one step of time alone."""
    slow, quick = found(noise(1, slow=True)), found(noise(2, slow=False), 0.1)
    sums = [drive(seed).sums() for seed in range(2)]
    assert with_common_noise(sums, [slow, quick]) == sums
    assert with_common_noise(sums[:1], [slow]) == sums[:1]


def test_at_the_frequencies_of_a_law_noise_is_as_before() -> None:
    """Where it was told apart from slow noise there."""
    recordings = [found(noise(seed, slow=True)) for seed in range(6)]
    recordings[0] = replace(recordings[0], autocorrelation_times=2.0)
    sums = [replace(drive(seed).sums(), reductions=np.array([1.0, 4.0, 1.0])) for seed in range(6)]
    after = with_common_noise(sums, recordings)[0]
    assert after.reductions[[0, 2]] == pytest.approx([1.0, 1.0])
    assert after.reductions[1] * after.weights[0] == pytest.approx(4.0 * sums[0].weights[0])
    assert np.all(after.weights < 1 / DEVIATION**2)
