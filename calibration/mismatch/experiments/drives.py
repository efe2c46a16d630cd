"""Drives that an experiment may have, predicted by the simulation: legs in which chosen covariates change and no other.

A drive is some dozen legs. Each varied covariate steps through a few values, in an order of its own, so that no two of
them change together; the others keep the medians of the recording. A drive may have a part without load at its end.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.data.recording import Recording
from regolithd.calibration.mismatch.experiments.settings import Setting, settings_of, usual_inputs
from regolithd.calibration.mismatch.problem.covariates import covariates_of
from regolithd.calibration.mismatch.problem.predictor import complete_inputs
from regolithd.calibration.mismatch.problem.problem import Problem
from regolithd.calibration.mismatch.regression.nuisance import tangents

if TYPE_CHECKING:
    from collections.abc import Iterable

Array = NDArray[np.float64]

LEGS, ROWS_PER_LEG, LEVELS = 48, 5, 4
"""Legs of a drive, rows of a leg, and values of each varied covariate: enough for the curve of a law (a choice)."""
UNLOADED_SHARE = 1 / 3
"""Share of a drive that is without load, where a part is (a choice)."""
ACCELERATING_SHARE = 0.2
"""Share of the rows in which the speed changes, where the acceleration is varied (a choice)."""
DIRECTION, SPEED, ACCELERATION, UNLOADED = "direction", "wheel_speed", "wheel_acceleration", "unloaded"
MOTION = frozenset({DIRECTION, SPEED, ACCELERATION})
"""What is varied both ways: an offset, of a sensor say, does not turn round with the motion."""


@dataclass(frozen=True, eq=False)
class Drive:
    """A drive as predicted.

    Attributes
    ----------
    problem: its recording without noise, and the simulation's prediction of it; its mask has the readings at which the
        prediction and its tangents are defined, with load or without (at a standstill they need not be)
    loaded: 1 where the machine carries its load, 0 where it does not, shape (time, 1)
    tangents: ∂prediction/∂parameter of each free parameter, shape (parameter, time, wheel)
    """

    problem: Problem
    loaded: Array
    tangents: Array


class Drives:
    """The drives that can be predicted for a recording's machine; each is predicted once.

    Attributes
    ----------
    problem: the recording and the simulation of it
    settings: of the covariates that can be set, by name
    """

    def __init__(self, problem: Problem, covariates: Iterable[str]) -> None:
        self.problem = problem
        self.settings = settings_of(problem, covariates)
        self._usual = usual_inputs(problem)
        self._driven: dict[frozenset[str], Drive] = {}

    @property
    def elements(self) -> tuple[str, ...]:
        """What a drive may vary: covariates, the direction, the acceleration; and whether a part is without load."""
        unloaded = (UNLOADED,) if self.problem.simulation.unloaded_experiment else ()
        moving = (ACCELERATION,) if self.problem.simulation.one_way else (DIRECTION, ACCELERATION)
        return (*self.settings, *(moving if SPEED in self.settings else ()), *unloaded)

    def __call__(self, varied: frozenset[str]) -> Drive:
        """Return the drive that varies these elements and nothing else."""
        if varied not in self._driven:
            self._driven[varied] = self._predicted(varied)
        return self._driven[varied]

    def _predicted(self, varied: frozenset[str]) -> Drive:
        rows = LEGS * ROWS_PER_LEG
        unloaded = np.zeros((rows, 1), bool)
        if UNLOADED in varied:
            unloaded[round((1 - UNLOADED_SHARE) * rows) :] = True
        recording = self._recording(varied, unloaded)
        problem = _problem(self.problem, recording, unloaded)
        problem = replace(problem, covariates={**problem.covariates, **self._acceleration(varied, problem.mask.shape)})
        loaded = (~unloaded).astype(np.float64)
        with np.errstate(all="ignore"):  # as in `_problem`
            found = np.array(tangents(problem)[2]).reshape(-1, *problem.mask.shape)
        known = problem.mask & np.isfinite(found).all(axis=0)
        return Drive(replace(problem, mask=known), loaded, np.where(known, found, 0.0) * loaded)

    def _recording(self, varied: frozenset[str], unloaded: NDArray[np.bool_]) -> Recording:
        """Return the inputs of the drive as a recording."""
        before, shape = self.problem.recording, (LEGS * ROWS_PER_LEG, self.problem.mask.shape[1])
        channels = {name: np.broadcast_to(values, shape) for name, values in self._usual.items()}
        for place, (name, setting) in enumerate(self.settings.items()):
            if name == SPEED:
                channels[setting.channel] = setting.channel_at(self._speeds(varied, setting, place, unloaded))
            elif name in varied:
                channels[setting.channel] = setting.channel_at(_steps(setting.low, setting.high, place))
        time_s: Array = np.arange(shape[0], dtype=np.float64) * before.step_s
        return Recording(time_s, np.zeros(shape[0], np.int64), before.wheels, channels)

    def _speeds(self, varied: frozenset[str], setting: Setting, place: int, unloaded: NDArray[np.bool_]) -> Array:
        """Return the speed, shape (time, wheel): both ways where anything of the motion varies, and without load."""
        known = np.where(self.problem.mask, self.problem.covariates[SPEED], np.nan)
        size = np.full(known.shape[1], np.nanmedian(np.abs(known)))
        ways = np.sign(np.nanmedian(known)) or 1.0
        steps = np.broadcast_to(_steps(setting.low, setting.high, place), (len(unloaded), len(size)))
        to_and_fro = ways if self.problem.simulation.one_way else _steps(-1.0, 1.0, len(self.settings), 2)
        speeds = np.where(unloaded | (SPEED in varied), steps, size)
        return np.asarray(speeds * np.where(unloaded | bool(MOTION & varied), to_and_fro, ways))

    def _acceleration(self, varied: frozenset[str], shape: tuple[int, ...]) -> dict[str, Array]:
        """Return the acceleration: none but where it is varied, since legs are long against changes of speed."""
        if ACCELERATION not in self.problem.covariates:
            return {}
        found = np.zeros(shape)
        if ACCELERATION in varied and SPEED in self.settings:
            known = np.abs(self.problem.covariates[ACCELERATION][self.problem.mask])
            largest = max(float(np.nanmax(known, initial=0.0)), self.settings[SPEED].high)
            at = np.arange(shape[0]) % round(1 / ACCELERATING_SHARE) == 0
            found[at] = largest * _steps(-1.0, 1.0, len(self.settings) + 1, 2)[at]
        return {ACCELERATION: found}


def _problem(of: Problem, recording: Recording, unloaded: NDArray[np.bool_]) -> Problem:
    """Return the problem of a drive whose readings are the prediction."""
    simulation, inputs = of.simulation, complete_inputs(recording)
    with np.errstate(all="ignore"):  # a prediction may be undefined at these inputs
        predicted = simulation.predict(inputs, {**simulation.variants(), **of.values})
    prediction = np.where(unloaded & np.isfinite(predicted), 0.0, predicted)
    varying, constants = covariates_of(recording, simulation, inputs, prediction, arbitrary_zero=of.arbitrary_zero)
    return Problem(
        recording=recording,
        simulation=simulation,
        values=of.values,
        measured=prediction,
        prediction=prediction,
        mask=np.isfinite(predicted),  # without load too: what cannot be predicted at these inputs has no tangents
        covariates={**constants, **varying},
        side=of.side,
        row=of.row,
        labels=of.labels,
        thresholds=of.thresholds,
    )


def _steps(low: float, high: float, place: int, levels: int = LEVELS) -> Array:
    """Return values from low to high, one for each leg, each as often, in the order of this place; shape (time, 1)."""
    of_legs = np.random.default_rng(place).permutation(np.resize(np.linspace(low, high, levels), LEGS))
    return np.repeat(of_legs, ROWS_PER_LEG)[:, None]
