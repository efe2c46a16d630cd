"""Drift of one load cell: the simulation gets a wrong load as its input, or is compared with a wrong one."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape
from regolithd.calibration.mismatch.candidates.growth import (
    GROWTH_KEYS,
    GROWTHS,
    growth,
    growth_form,
    onset_grid,
    onset_range,
)
from regolithd.calibration.mismatch.problem.inputs.errors_in_variables import known_mean
from regolithd.calibration.mismatch.signal.hat_basis import hat_functions
from regolithd.calibration.mismatch.signal.noise_models.noise import estimate_noise

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.problem.predictor import Predictor
    from regolithd.calibration.mismatch.problem.problem import Problem

WANDER_KNOTS, POSTURE_KNOTS = 24, 4
"""Knots of the broken line through a drift, and of the one that is fitted together with pitch and roll (a choice: one
for each 4 % of the recording; few enough not to follow the posture)."""
OFFSETS = (-3.0, -2.2, -1.6, -1.1, -0.8, -0.55, -0.4, -0.2, 0.0, 0.15, 0.3, 0.4, 0.5, 0.7, 0.85)
"""Offsets of the drift in mean readings, at which the simulation runs; a parabola interpolates between them (a choice:
dense where the current depends on the load most)."""

LEAST_SHARE = 0.1
"""Share of the reading that is left of the load at least: the contact model needs a positive load (a choice)."""
LEAST_READINGS = 10
"""Readings below which no posture is fitted: as many as the regression has columns."""
RISES = (0.05, 0.15)
"""Time constants of a predicted load's creep, as shares of the recording (a choice: quick and slow)."""


FURTHER_POWERS = (0.5, 2.0)
"""Powers of the time since the onset that the onset's estimate takes in too (a choice: a factor of two either way of a
steady drift)."""


class LoadCellDrift(Candidate):
    """A load reading that drifts while the current does not follow it.

    Two channels have to show it: the current, which does not respond to the load that the cell reports, and the cell
    itself, whose reading departs from what pitch and roll explain.
    """

    name = "load-cell-drift"
    covariate = "time"
    channel: ClassVar[str | None] = "load_N"
    equation = "W = W_cell − D(t);  Δy = −(∂y/∂W) D(t)"
    words = "a load cell whose reading drifts"
    signature = "one wheel's load departs from what pitch and roll explain, and its current does not follow"
    experiment = "repeat the beginning of what was recorded as it was, with the same load"
    run_unloaded = True
    source = "creep and temperature drift of faulty strain gauges: some percent of full scale per hour"
    requires: ClassVar[tuple[str, ...]] = ("load", "pitch", "roll")
    acts_unloaded = False
    coefficients: ClassVar = (Coefficient("drift_as_the_cell_shows_it", "1", 1),)
    sharing: ClassVar = ("one",)
    shape_keys: ClassVar[Mapping[str, str]] = {
        "relative_offset": "the drift's mean, which the cell does not show, in mean readings",
    }
    free: ClassVar = {"relative_offset": (-3.0, 0.85)}

    def form_for(self, simulation: Predictor) -> Candidate:
        """Return another form where the simulation predicts what the cell reads."""
        return DriftOfPredictedLoad() if simulation.channel.startswith("load") else self

    def shapes(self, problem: Problem) -> Sequence[Shape]:  # noqa: ARG002
        """Return the drift as the cell shows it, with several offsets of its mean."""
        return [{"relative_offset": offset} for offset in OFFSETS[2:-2]]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return the change of the prediction when the drift is taken out of the load.

        The cell shows how the drift varied, but not its mean: that is the shape parameter `relative_offset`, in mean
        readings.
        """
        # The search needs hundreds of offsets: the simulation runs at a few, a parabola through three interpolates.
        offset = float(shape["relative_offset"])
        middle = int(np.clip(np.argmin(np.abs(np.array(OFFSETS) - offset)), 1, len(OFFSETS) - 2))
        at = OFFSETS[middle - 1 : middle + 2]
        total = np.zeros(problem.mask.shape)
        for here in at:
            weight = np.prod([(offset - other) / (here - other) for other in at if other != here])
            total += weight * self._simulated(problem, here)
        return total[None]

    def search_range(
        self, problem: Problem, shape: Shape, name: str, bounds: tuple[float, float]
    ) -> tuple[float, float]:
        """Return the whole range of offsets: the grid's best one may be one at which the two channels disagree."""
        return bounds if name == "relative_offset" else super().search_range(problem, shape, name, bounds)

    def own_channel_evidence(self, problem: Problem, shape: Shape) -> tuple[Array, Array] | None:  # noqa: ARG002
        """Return Δχ² of the drift in each cell's own reading, and its coefficient there, which is 1."""
        gain = problem.once("drift seen by the cell", lambda: self._own_channel_gain(problem))
        return gain, np.ones(problem.mask.shape[1])

    def _own_channel_gain(self, problem: Problem) -> Array:
        reading, drift = self._unexplained_load(problem), self._drift(problem)
        noise = estimate_noise(np.nan_to_num(reading - drift), np.isfinite(reading))
        seen = np.nansum(np.where(np.isfinite(reading), drift**2, 0.0), axis=0) * noise.weights
        # Each knot gains 1 by chance; what half of the cells show is the ground, not a fault.
        usual = float(np.median(seen)) if len(seen) > 2 else 0.0
        return np.maximum(seen - max(usual, WANDER_KNOTS), 0.0)

    def _simulated(self, problem: Problem, offset: float) -> Array:
        def change() -> Array:
            load = problem.covariates["load"]
            wrong = known_mean(load) * (self._drift(problem) + offset)
            return problem.with_input("load_N", np.maximum(load - wrong, LEAST_SHARE * load)) - problem.filled

        return problem.run_once("drift with offset", offset, change)

    def _drift(self, problem: Problem) -> Array:
        return problem.once(
            "drift",
            lambda: np.stack([_wander(problem, reading) for reading in self._unexplained_load(problem).T], axis=1),
        )

    def _unexplained_load(self, problem: Problem) -> Array:
        """Return the cells' readings less what pitch and roll explain, over the mean reading; NaN where unknown."""

        def unexplained() -> Array:
            load = problem.covariates["load"]
            usual = known_mean(load)
            return _without_posture(problem, load / np.where(usual > 0, usual, 1.0))

        return problem.once("unexplained load", unexplained)


class DriftOfPredictedLoad(LoadCellDrift):
    """The drift of a cell whose reading is predicted: it departs after an onset, whatever the load is."""

    channel = None
    requires = ()
    acts_unloaded = True
    equation = "ΔW = D g(t − t_0)"
    signature = "one reading departs from the prediction after some time, by an amount that does not depend on the load"
    experiment = "take the load off, note the reading, and repeat with a known load"
    along_motion = False
    forms = GROWTHS[1:]
    wanders = True
    once_begun = "current-sensor-bias"
    coefficients: ClassVar = (Coefficient("drift", "{unit}", 0),)
    shape_keys = GROWTH_KEYS
    free: ClassVar = {"onset_s": (0.0, float("inf"))}

    def form_of(self, shape: Shape) -> str:
        """Return how the reading departs after the onset."""
        return growth_form(shape)

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Return, for each onset, two exponential approaches (creep) and a steady ramp."""
        ways: list[Shape] = [{"rise_s": share * problem.length_s} for share in RISES]
        ways.append({"full_at_s": problem.length_s})
        return [{"onset_s": t, **way} for t in onset_grid(problem) for way in ways]

    def onset_profiles(self, problem: Problem) -> Sequence[Shape]:
        """Add drifts that slow down and that speed up: the onset's estimate depends on how the drift grows after it."""
        further: list[Shape] = [{"full_at_s": problem.length_s, "power": power} for power in FURTHER_POWERS]
        return [*super().onset_profiles(problem), *further]

    def without_covariate(self, shape: Shape) -> Shape:  # noqa: ARG002
        """Return an offset that was there from the first reading on, which is no drift."""
        return {"onset_s": 0.0, "rise_s": 0.0}

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return g(t − t_0), 0 before the onset."""
        return np.broadcast_to(growth(problem, shape), problem.mask.shape)[None]

    def bounds(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:  # noqa: ARG002
        """Return the recording without its ends: the reading must be seen before the drift and with it."""
        return {"onset_s": onset_range(problem)}

    def own_channel_evidence(self, problem: Problem, shape: Shape) -> None:  # noqa: ARG002
        """Return nothing: the predicted channel is the cell's own."""
        return


def _without_posture(problem: Problem, values: Array) -> Array:
    """Return each column less its mean and its regression on pitch and roll.

    The regression has a broken line over time beside it: a slope that changes slowly resembles a drift, and without the
    line the regression would absorb the drift. A line with many knots would absorb the posture instead.
    """
    left = np.full(values.shape, np.nan)
    for k in range(values.shape[1]):
        pitch, roll = (np.nan_to_num(problem.covariates[name][:, k]) for name in ("pitch", "roll"))
        posture = np.column_stack((pitch, roll, pitch**2, roll**2, pitch * roll))
        known = np.isfinite(values[:, k])
        if known.sum() > LEAST_READINGS:
            line = hat_functions(problem.time_s[:, 0], known, POSTURE_KNOTS) or [np.ones(len(pitch))]
            beside = np.column_stack((posture, *line))
            fitted = np.linalg.lstsq(beside[known], values[known, k], rcond=None)[0][: posture.shape[1]]
            rest = values[known, k] - posture[known] @ fitted
            left[known, k] = rest - np.mean(rest)
    return left


def _wander(problem: Problem, reading: Array) -> Array:
    """Return the least-squares broken line over time through one cell's reading."""
    known = np.isfinite(reading)
    hats = hat_functions(problem.time_s[:, 0], known, WANDER_KNOTS)
    if not hats:
        return np.zeros(len(reading))
    columns = np.stack(hats, axis=1)
    fitted = np.linalg.lstsq(columns[known], reading[known], rcond=None)[0]
    return columns @ fitted
