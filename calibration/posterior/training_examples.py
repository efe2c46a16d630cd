"""Training examples of the posterior network: windows of simulated rovers, and the truth behind them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.parameters import Drivetrain, Wheel
from regolithd.calibration.posterior import simulated_rovers
from regolithd.calibration.posterior.window import Windows, reduce_windows

if TYPE_CHECKING:
    from collections.abc import Callable

Array = NDArray[np.float64]

INSTANTS = {1: 0.2, 2: 0.06, 4: 0.07, 8: 0.1, 20: 0.47, 40: 0.1}
"""Number of instants in a window: share of the examples."""

_CHUNK = 4000


@dataclass(frozen=True, slots=True, eq=False)
class TrainingExamples:
    """Windows and their truth: ln(c / Pa), φ [rad] and drawbar margin [1], shape (N, 3)."""

    windows: Windows
    truth: Array


def simulate_examples(
    count: int, rng: np.random.Generator, progress: Callable[[int], None] = lambda _: None
) -> TrainingExamples:
    """Simulate `count` windows, some with wheels that are not measured; `progress` is called with finished numbers."""
    parts = []
    for instants, share in INSTANTS.items():
        left = round(count * share)
        while left > 0:
            size = min(left, _CHUNK)
            parts.append(_simulate_chunk(size, instants, rng))
            left -= size
            progress(size)
    windows = Windows(
        np.concatenate([part.windows.wheels for part in parts]),
        np.concatenate([part.windows.mask for part in parts]),
        np.concatenate([part.windows.known for part in parts]),
    )
    return TrainingExamples(windows, np.concatenate([part.truth for part in parts]))


def _simulate_chunk(count: int, instants: int, rng: np.random.Generator) -> TrainingExamples:
    wheel = Wheel()
    rovers = simulated_rovers.draw_rovers(count, rng)
    noise = simulated_rovers.draw_noise(count, rng)
    measured = simulated_rovers.simulate_measurements(rovers, noise, instants, rng, Drivetrain(), wheel)
    uncertainty = rovers.uncertainty.copy()
    uncertainty[:, 3] = simulated_rovers.stated_noise(rovers, noise, Drivetrain().gain_Nm_per_A, rng)
    soil_index = np.where(rng.random(count) < 0.5, rovers.nearest_class, -1)
    load = np.where(_measured_wheels(count, instants, rng)[:, None], measured.load_N, np.nan)
    windows = reduce_windows(load, measured.slip, measured.torque_Nm, uncertainty, wheel.radius_m, soil_index)
    truth = np.column_stack(
        [
            np.log(rovers.soils.cohesion_Pa),
            np.radians(rovers.soils.friction_angle_deg),
            simulated_rovers.drawbar_margins(rovers, wheel),
        ]
    )
    return TrainingExamples(windows, truth)


def _measured_wheels(count: int, instants: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Draw which wheels are measured: usually all six, at least one; for windows of one instant often only one."""
    shares = [0.4, 0.15, 0.45] if instants == 1 else [0.75, 0.15, 0.1]
    share = rng.choice([1.0, 0.75, 0.0], size=(count, 1), p=shares)
    measured = rng.random((count, 6)) < share
    measured[np.arange(count), rng.integers(6, size=count)] = True
    return measured
