"""One load cell wanders: the simulation is told a load that is not there."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape
from regolithd.calibration.mismatch.problem.errors_in_variables import known_mean
from regolithd.calibration.mismatch.signal.hat_basis import broken_lines
from regolithd.calibration.mismatch.signal.noise import estimate_noise

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem

WANDER_KNOTS, POSTURE_KNOTS = 24, 4
"""Of the line that a drift follows; and of the one that is fitted beside what pitch and roll say."""
OFFSETS = (-3.0, -2.2, -1.6, -1.1, -0.8, -0.55, -0.4, -0.2, 0.0, 0.15, 0.3, 0.4, 0.5, 0.7, 0.85)
"""Mean readings that a drift may have been off by, at which it is simulated."""


class LoadCellDrift(Candidate):
    """A reading that creeps away; the current does not follow it.

    Seen twice: in the current, which does not answer to the load that the cell claims, and in the cell itself,
    against what pitch and roll say it should carry. Both are asked for: what the cell does not show is another
    effect, and a load that the current follows is a load.
    """

    name = "load-cell-drift"
    covariate = "time"
    channel = "load_N"
    equation = "W = W_cell − D(t);  ΔI = −(∂I/∂W) D(t)"
    words = "a load cell that wanders"
    signature = "one wheel's load leaves what pitch and roll explain, and its current does not follow"
    experiment = "drive back over the same ground, and lift the wheels and spin all six at one speed"
    source = "strain-gauge creep and temperature: percents of full scale per hour when faulty"
    requires = ("load", "pitch", "roll")
    acts_unloaded = False
    coefficients: ClassVar = (Coefficient("drift_as_the_cell_shows_it", "1", 1),)
    sharing: ClassVar = ("one",)
    free: ClassVar = {"relative_offset": (-3.0, 0.85)}

    def shapes(self, problem: Problem) -> Sequence[Shape]:  # noqa: ARG002
        """As the cell itself shows it, from several readings that were wrong on the mean already."""
        return [{"relative_offset": offset} for offset in OFFSETS[2:-2]]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return what the simulation says to the load without the drift, less what it said.

        The cell shows how the drift went, but not what it was on the mean: that is the offset, in mean readings.
        """
        # Simulated at a few offsets, since a search asks for hundreds; the parabola through the nearest three between.
        offset = float(shape["relative_offset"])
        middle = int(np.clip(np.argmin(np.abs(np.array(OFFSETS) - offset)), 1, len(OFFSETS) - 2))
        at = OFFSETS[middle - 1 : middle + 2]
        total = np.zeros(problem.mask.shape)
        for here in at:
            weight = np.prod([(offset - other) / (here - other) for other in at if other != here])
            total += weight * self._simulated(problem, here)
        return total[None]

    def own_channel_evidence(self, problem: Problem, shape: Shape) -> tuple[Array, Array]:  # noqa: ARG002
        """Return, for each wheel, what this drift explains of its own cell's reading, and how large it is there."""
        key = ("drift seen by the cell", 0.0)
        if key not in problem.made:
            reading, drift = self._unexplained_load(problem), self._drift(problem)
            noise = estimate_noise(np.nan_to_num(reading - drift), np.isfinite(reading))
            seen = np.nansum(np.where(np.isfinite(reading), drift**2, 0.0), axis=0) * noise.weights
            # A line of many pieces follows noise too: each piece gains 1 by chance. And the ground: that all cells do.
            usual = float(np.median(seen)) if len(seen) > 2 else 0.0
            problem.made[key] = np.maximum(seen - max(usual, WANDER_KNOTS), 0.0)
        return problem.made[key], np.ones(problem.mask.shape[1])

    def _simulated(self, problem: Problem, offset: float) -> Array:
        key = ("drift with offset", offset)
        if key not in problem.made:
            load = problem.covariates["load"]
            wrong = known_mean(load) * (self._drift(problem) + offset)
            problem.made[key] = problem.with_input("load_N", np.maximum(load - wrong, 0.1 * load)) - problem.filled
        return problem.made[key]

    def _drift(self, problem: Problem) -> Array:
        key = ("drift", 0.0)
        if key not in problem.made:
            reading = self._unexplained_load(problem)
            problem.made[key] = np.stack([_wander(problem, reading[:, k]) for k in range(reading.shape[1])], axis=1)
        return problem.made[key]

    def _unexplained_load(self, problem: Problem) -> Array:
        """Return the cells' readings less what pitch and roll explain, over the mean reading; NaN where unknown."""
        key = ("unexplained load", 0.0)
        if key not in problem.made:
            load = problem.covariates["load"]
            problem.made[key] = _without_posture(problem, load / np.where(known_mean(load) > 0, known_mean(load), 1.0))
        return problem.made[key]


def _without_posture(problem: Problem, values: Array) -> Array:
    """Return each column less its mean and what pitch and roll say, fitted beside a line of few pieces over time.

    Over half an hour a slope that changes slowly looks like a drift: fitted alone, posture would take the drift along.
    A line of many pieces, though, would take the posture along.
    """
    left = np.full(values.shape, np.nan)
    for k in range(values.shape[1]):
        pitch, roll = (np.nan_to_num(problem.covariates[name][:, k]) for name in ("pitch", "roll"))
        posture = np.column_stack((pitch, roll, pitch**2, roll**2, pitch * roll))
        known = np.isfinite(values[:, k])
        if known.sum() > 10:
            line = broken_lines(problem.time_s[:, 0], known, POSTURE_KNOTS) or [np.ones(len(pitch))]
            beside = np.column_stack((posture, *line))
            fitted = np.linalg.lstsq(beside[known], values[known, k], rcond=None)[0][: posture.shape[1]]
            rest = values[known, k] - posture[known] @ fitted
            left[known, k] = rest - np.mean(rest)
    return left


def _wander(problem: Problem, reading: Array) -> Array:
    """Return a broken line over time through a reading."""
    known = np.isfinite(reading)
    hats = broken_lines(problem.time_s[:, 0], known, WANDER_KNOTS)
    if not hats:
        return np.zeros(len(reading))
    columns = np.stack(hats, axis=1)
    fitted = np.linalg.lstsq(columns[known], reading[known], rcond=None)[0]
    return columns @ fitted
