"""Compare smoothing filters on the noise of the paper's Table 4, with momentary drops.

    python tests/bench/smoothing_study.py

Prints a table, and writes build/figures/smoothing.json. Every filter gets the same 360 wheel-minutes.
"""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from regolithd.daemon.config.configuration import Smoothing
from regolithd.daemon.pipeline.smooth import Smoother
from regolithd.daemon.pipeline.snapshot import Array
from regolithd.daemon.simulator.spatial_noise import CorrelatedNoise, MomentaryDrops

Filter = Callable[[Array, float], Array]
RELATIVE_STD, CORRELATION_S = 0.31, 0.2
SECONDS, STEP_AT_S, SETTLED_S = 120.0, 60.0, 15.0
SEEDS = range(30)


def series(seed: int, rate_Hz: float, step: float, drops_per_s: float, drop_s: float, depth: float) -> Array:
    """Return a current of 1 with noise, drops and a permanent step; shape (time, 6)."""
    noise_seed, drop_seed = np.random.SeedSequence(seed).spawn(2)
    noise, drops = CorrelatedNoise(noise_seed, 6, CORRELATION_S), MomentaryDrops(drop_seed, 6, drops_per_s, drop_s)
    times = np.arange(int(SECONDS * rate_Hz)) / rate_Hz
    level = np.where(times >= STEP_AT_S, 1 + step, 1.0)
    return np.stack(
        [
            at * (1 + RELATIVE_STD * noise.at(t)) * (1 - depth * drops.at(t))
            for t, at in zip(times.tolist(), level, strict=True)
        ]
    )


def shipped(**changed: float) -> Filter:
    """Return the daemon's filter."""

    def apply(values: Array, rate_Hz: float) -> Array:
        smoother = Smoother(rate_Hz, **(Smoothing().model_dump() | changed))
        return np.stack([smoother.step(int(k * 1e9 / rate_Hz), row, row, row).torque for k, row in enumerate(values)])

    return apply


def trailing(function: Callable[..., Array], window_s: float) -> Filter:
    """Return a trailing mean or median."""

    def apply(values: Array, rate_Hz: float) -> Array:
        length = round(window_s * rate_Hz) // 2 * 2 + 1
        return np.stack([function(values[max(0, k - length + 1) : k + 1], axis=0) for k in range(len(values))])

    return apply


def then(first: Filter, second: Filter) -> Filter:
    """Return both filters in series."""
    return lambda values, rate_Hz: second(first(values, rate_Hz), rate_Hz)


FILTERS: dict[str, Filter] = {
    "none": lambda values, _rate_Hz: values,
    "mean 3.5 s": trailing(np.mean, 3.5),
    "median 3.5 s": trailing(np.median, 3.5),
    "low-pass 1.5 s": shipped(threshold=0.0),
    "median 2.5 s, low-pass 1 s": then(trailing(np.median, 2.5), shipped(threshold=0.0, time_constant_s=1.0)),
    "drop test, low-pass (shipped)": shipped(),
}


def delay(step_response: Array, rate_Hz: float, share: float) -> float:
    """Return the time after the step at which a share of it is reached [s], of the mean over all wheels."""
    times = np.arange(len(step_response)) / rate_Hz
    before = step_response[(times > SETTLED_S) & (times < STEP_AT_S)].mean()
    after = step_response[times > STEP_AT_S + 25].mean()
    reached = (before - step_response) / (before - after) >= share
    return float(times[(times >= STEP_AT_S) & reached][0] - STEP_AT_S)


def dip(apply: Filter, rate_Hz: float, lasting_s: float) -> float:
    """Return the largest deviation after one drop to a fifth, in percent of the level; mean over 400 wheels."""
    steady = 1 + 0.1 * np.random.default_rng(0).standard_normal((int(30 * rate_Hz), 6 * 66))
    begin, length = int(15 * rate_Hz), max(1, int(lasting_s * rate_Hz))
    dropped = steady.copy()
    dropped[begin : begin + length] *= 0.2
    sets = range(0, steady.shape[1], 6)
    difference = [apply(steady[:, k : k + 6], rate_Hz) - apply(dropped[:, k : k + 6], rate_Hz) for k in sets]
    return float(100 * np.concatenate(difference, axis=1).mean(axis=1)[begin:].max())


def measure(apply: Filter, rate_Hz: float) -> dict[str, float]:
    """Return the figures of one filter at one rate."""

    def all_of(step: float, drops: float = 0.15) -> Array:
        return np.concatenate([apply(series(s, rate_Hz, step, drops, 0.5, 0.8), rate_Hz) for s in SEEDS], axis=1)

    falling = all_of(-0.25)
    steady = falling[int(SETTLED_S * rate_Hz) : int(STEP_AT_S * rate_Hz)]
    undisturbed = all_of(-0.25, drops=0.0)[int(SETTLED_S * rate_Hz) : int(STEP_AT_S * rate_Hz)]
    return {
        "bias_percent": 100 * (steady.mean() - 1),
        "bias_without_drops_percent": 100 * (undisturbed.mean() - 1),
        "std_percent": 100 * steady.std(),
        "drop_0.5s_percent": dip(apply, rate_Hz, 0.5),
        "drop_1s_percent": dip(apply, rate_Hz, 1.0),
        "step_25_half_s": delay(falling.mean(axis=1), rate_Hz, 0.5),
        "step_25_ninety_s": delay(falling.mean(axis=1), rate_Hz, 0.9),
        "step_60_ninety_s": delay(all_of(-0.6).mean(axis=1), rate_Hz, 0.9),
    }


def main() -> None:
    """Measure all, print, write."""
    figures: dict[str, float] = {}
    for rate_Hz in (2.0, 10.0):
        for name, apply in FILTERS.items():
            found = measure(apply, rate_Hz)
            print(f"{rate_Hz:4g} Hz  {name:30}", *(f"{key} {value:6.1f}" for key, value in found.items()))
            figures |= {f"{name}, {rate_Hz:g} Hz, {key}": round(value, 2) for key, value in found.items()}
    out = Path("build/figures/smoothing.json")
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(figures, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
