"""A ripple that a larger effect hides is found in what the larger one leaves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from winch import Winch

from regolithd.calibration.mismatch import compare

Array = NDArray[np.float64]
COUNT, STEP_S, DRUMS, ORDER, AMPLITUDE_A = 1500, 0.1, 4, 7.0, 1.0


def hoisted(seed: int) -> dict[str, Array]:
    """Return drives to and fro with a drag of the square of the speed on all, and a ripple on the first drum."""
    random, time = np.random.default_rng(seed), STEP_S * np.arange(COUNT)
    stops = np.linspace(0, time[-1], 30)
    speed = np.stack([np.interp(time, stops, random.uniform(-2.5, 2.5, 30)) for _ in range(DRUMS)], axis=1)
    pull = 625 + 200 * np.stack([np.interp(time, stops, random.normal(size=30)) for _ in range(DRUMS)], axis=1)
    travel = np.cumsum(speed, axis=0) * STEP_S
    ripple = AMPLITUDE_A * np.cos(ORDER * travel) * (np.arange(DRUMS) == 0)
    current = 0.02 * pull + 2.0 * speed * np.abs(speed) + ripple + random.normal(0, 0.7, speed.shape)
    return {
        "t_s": np.repeat(time, DRUMS),
        "drum": np.tile(np.arange(1.0, DRUMS + 1), COUNT),
        "speed": speed.ravel(),
        "pull_N": pull.ravel(),
        "current_A": current.ravel(),
    }


def test_a_ripple_beside_a_larger_drag_has_its_name_and_order() -> None:
    """On its drum, with its amplitude; a slow drag has far more power at low orders than the ripple has at its own."""
    answer = compare(hoisted(1), Winch()).answer
    found = {effect.name: effect for effect in answer.effects}
    assert set(found) == {"quadratic-drag", "wheel-angle-ripple"}
    ripple = found["wheel-angle-ripple"]
    assert ripple.wheels == (1,)
    amplitude, order = ripple.parameters["amplitude"], ripple.parameters["order"]
    assert amplitude.low < AMPLITUDE_A < amplitude.high
    assert order.low - 0.01 < ORDER < order.high + 0.01
