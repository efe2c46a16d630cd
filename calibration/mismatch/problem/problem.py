"""What candidates are built from: the calibrated simulation, its tangents, and all that was measured, at one place."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import RecordingError
from regolithd.calibration.mismatch.problem.errors_in_variables import expected_inputs
from regolithd.calibration.mismatch.problem.predictor import complete_inputs

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.predictor import Predictor

Array = NDArray[np.float64]

ALWAYS = frozenset({"wheel_speed", "direction", "wheel_acceleration", "wheel_angle", "time", "torque"})
"""Covariates that mean something even where they are constant."""
SPIKE = 15.0
"""A residual this many times the usual one is a fault of the recording, not of the simulation."""
CHANGES = 0.05
"""Share of its root mean square by which a factor must change on a wheel: less, no law is known to."""
RELATIVE_STEP = 0.01
"""Of a parameter or an input, for a tangent: small against what matters, large against rounding."""


@dataclass(frozen=True)
class Problem:
    """A recording and a simulation of it.

    Attributes
    ----------
    recording: with inputs replaced by their conditional expectation
    values: the simulation's parameters
    measured: the channel that is predicted, shape (time, wheel)
    prediction: the simulation's, NaN where it says nothing
    mask: where both are known
    covariates: by the contract's names, each of shape (time, wheel)
    side, row: each wheel's place on the machine, or None
    made: what candidates have computed once for all
    """

    recording: Recording
    simulation: Predictor
    values: Mapping[str, float]
    measured: Array
    prediction: Array
    mask: NDArray[np.bool_]
    covariates: Mapping[str, Array]
    side: Array | None
    row: Array | None
    made: dict[tuple[str, float], Array] = field(default_factory=dict, repr=False)

    @property
    def time_s(self) -> Array:
        """Seconds from the first instant, shape (time, 1); one run after the other."""
        return self.covariates["time"][:, :1]

    @property
    def length_s(self) -> float:
        """From the first instant to the last [s]."""
        return float(self.time_s[-1, 0] - self.time_s[0, 0])

    @property
    def mean_size(self) -> float:
        """The predicted channel's mean magnitude: what effects are measured against."""
        return float(np.mean(np.abs(self.measured[self.mask])))

    def has(self, *names: str) -> bool:
        """Say whether all these covariates were measured and vary."""
        return all(name in self.covariates for name in names)

    def changes_within(self, values: Array) -> bool:
        """Say whether a factor (time, wheel) changes on a wheel as it drives, not only from wheel to wheel."""
        return self.variance_within(values) > CHANGES**2 * float(np.mean(values[self.mask] ** 2))

    def variance_within(self, values: Array) -> float:
        """Return the mean, over the wheels of which it is known, of what a quantity (time, wheel) varies on each."""
        known = self.mask & np.isfinite(values)
        kept = np.where(known, values, np.nan)[:, known.any(axis=0)]
        return float(np.mean(np.nanvar(kept, axis=0)))

    def changed(self, **changes: float) -> Array:
        """Return the prediction with parameters (or variants) set otherwise."""
        values = {**self.simulation.variants(), **self.values, **changes}
        return np.where(self.mask, self.simulation.predict(complete_inputs(self.recording), values), 0.0)

    def secant(self, name: str, step: float) -> Array:
        """Return the prediction's change per unit of a parameter, over a step from where it stands."""
        key = (name, step)
        if key not in self.made:
            start = {**self.simulation.variants(), **self.values}[name]
            self.made[key] = (self.changed(**{name: start + step}) - self.filled) / step
        return self.made[key]

    def tangent(self, name: str) -> Array:
        """Return ∂prediction/∂parameter, shape (time, wheel)."""
        start = {**self.simulation.variants(), **self.values}[name]
        return self.secant(name, RELATIVE_STEP * (abs(start) or 1.0))

    def input_tangent(self, column: str) -> Array:
        """Return ∂prediction/∂ln(input), shape (time, wheel)."""
        key = ("input " + column, RELATIVE_STEP)
        if key not in self.made:
            moved = self.with_input(column, self.recording.channels[column] * (1 + RELATIVE_STEP))
            self.made[key] = (moved - self.filled) / RELATIVE_STEP
        return self.made[key]

    def with_input(self, column: str, values: Array) -> Array:
        """Return the prediction for another reading of one input, 0 where the simulation says nothing."""
        inputs = {**complete_inputs(self.recording), column: values}
        moved = self.simulation.predict(inputs, {**self.simulation.variants(), **self.values})
        return np.where(self.mask & np.isfinite(moved), moved, 0.0)

    @property
    def filled(self) -> Array:
        """The prediction, 0 where the simulation says nothing."""
        return np.where(self.mask, self.prediction, 0.0)


def build_problem(recording: Recording, simulation: Predictor, values: Mapping[str, float] | None = None) -> Problem:
    """Simulate the recording.

    Raises
    ------
    RecordingError
        When the predicted channel or an input is missing, or nothing can be compared.
    """
    derived = simulation.prepare(recording)
    needed = (simulation.channel, *simulation.inputs)
    if missing := [name for name in needed if not np.isfinite(derived.channel(name)).any()]:
        raise RecordingError(f"the simulation needs {', '.join(missing)}, which the recording does not have")
    prepared = expected_inputs(derived, simulation.sensors)
    chosen = dict(values or {name: prior.value for name, prior in simulation.parameters.items()})
    inputs = complete_inputs(prepared)
    prediction = simulation.predict(inputs, {**simulation.variants(), **chosen})
    measured = prepared.channel(simulation.channel)
    mask = np.isfinite(prediction) & np.isfinite(measured)
    mask &= ~_spikes(np.where(mask, measured - prediction, np.nan))
    if mask.sum() < 100:
        raise RecordingError(
            f"only {mask.sum()} values of {simulation.channel} can be compared; at least 100 are needed"
        )
    covariates = _covariates(prepared, simulation, inputs, prediction)
    wheels = recording.wheels
    return Problem(
        prepared,
        simulation,
        chosen,
        measured,
        prediction,
        mask,
        covariates,
        simulation.side(wheels),
        simulation.row(wheels),
    )


def _spikes(residual: Array) -> NDArray[np.bool_]:
    """Return where single readings lie far outside of what all others do."""
    if not np.isfinite(residual).any():
        return np.zeros(residual.shape, np.bool_)
    middle = float(np.nanmedian(residual))
    usual = 1.4826 * float(np.nanmedian(np.abs(residual - middle)))
    return (np.abs(residual - middle) > SPIKE * usual) & (usual > 0)


def _covariates(
    recording: Recording, simulation: Predictor, inputs: Mapping[str, Array], prediction: Array
) -> dict[str, Array]:
    """Return what was measured, and what follows from it; what was never measured or never varies is left out."""
    found = dict(simulation.covariates(inputs))
    found["time"] = np.broadcast_to(_elapsed(recording)[:, None], recording.shape)
    found.setdefault("torque", np.abs(prediction))
    if "wheel_speed" in found:
        speed = found["wheel_speed"]
        found["direction"] = np.sign(speed)
        found["wheel_acceleration"] = _derivative(speed, recording)
        found["wheel_angle"] = _integral(speed, recording)
    return {name: values for name, values in found.items() if name in ALWAYS or _varies(values)}


def _varies(values: Array) -> bool:
    """Say whether a covariate was measured at all, and is not one number."""
    known = values[np.isfinite(values)]
    return bool(known.size) and float(np.ptp(known)) > 1e-12 * float(np.max(np.abs(known)))


def _elapsed(recording: Recording) -> Array:
    """Return seconds with all runs put one after the other, shape (time,)."""
    steps = np.diff(recording.time_s, prepend=recording.time_s[0])
    steps[np.flatnonzero(np.diff(recording.run)) + 1] = recording.step_s
    return np.cumsum(steps)


def _derivative(values: Array, recording: Recording) -> Array:
    """Return the rate of change by central differences; 0 across gaps and between runs."""
    ahead = np.diff(values, axis=0)
    steps = np.diff(recording.time_s)
    whole = (np.diff(recording.run) == 0) & (steps < 3 * recording.step_s) & (steps > 0)
    rate = np.where(whole[:, None], ahead / np.where(whole, steps, 1.0)[:, None], 0.0)
    before, after = np.vstack((rate[:1] * 0, rate)), np.vstack((rate, rate[:1] * 0))
    return np.nan_to_num(0.5 * (before + after))


def _integral(values: Array, recording: Recording) -> Array:
    """Return the angle turned since the start (trapezium); a gap is bridged, its angle is not known."""
    steps = np.diff(recording.time_s)
    steps = np.where((np.diff(recording.run) == 0) & (steps > 0), steps, 0.0)
    known = np.nan_to_num(values)
    return np.vstack(
        (np.zeros((1, values.shape[1])), np.cumsum(0.5 * (known[1:] + known[:-1]) * steps[:, None], axis=0))
    )
