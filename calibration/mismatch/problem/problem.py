"""The problem that a recording and a simulation pose together: prediction, tangents and covariates at one place."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.inputs.errors_in_variables import known_mean
from regolithd.calibration.mismatch.problem.inputs.input_doubt import bias_of
from regolithd.calibration.mismatch.problem.predictor import complete_inputs
from regolithd.calibration.mismatch.problem.readings.zero import zero_is_arbitrary
from regolithd.calibration.mismatch.problem.tangents.principal_axes import tangents_where_it_switches
from regolithd.calibration.mismatch.problem.tangents.recent_arrays import RecentArrays
from regolithd.calibration.mismatch.signal.noise_models.noise import NoiseModel, estimate_noise
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Mapping

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.corrections.size_posterior import SizePosterior
    from regolithd.calibration.mismatch.problem.inputs.input_doubt import InputDoubt
    from regolithd.calibration.mismatch.problem.predictor import Predictor

Array = NDArray[np.float64]
Readings = tuple[NDArray[np.int64], tuple[slice, ...]]
"""Rows in the order of time, and which of them followed each other."""

LONGEST_BRIDGE = 4
"""Usual steps between readings that may be left out before a new run begins (a choice: blanks are short)."""


@dataclass(frozen=True)
class LeftOut:
    """Readings of a channel that are not compared, and why."""

    channel: str
    readings: int
    reason: str


@dataclass(frozen=True, eq=False)
class StatedEffect:
    """An effect that a corrected simulation has already.

    Attributes
    ----------
    name: the candidate's
    wheels: the names of the wheels that have it
    column: what it adds to the prediction, shape (time, wheel)
    relative_std: relative standard deviation of its size, from the comparison that found it
    in_simulation: whether the simulation's own prediction has it; else it is added on the output
    on_time: whether it is the delay of an input that the problem has on time, so that its prediction has it
    deviations: what one standard deviation of other numbers in its law adds, shape (time, wheel) each
    posterior: of its size together with the simulation's parameters, from the comparison that found it
    """

    name: str
    wheels: tuple[int | str, ...]
    column: Array
    relative_std: float
    in_simulation: bool = False
    on_time: bool = False
    deviations: tuple[Array, ...] = ()
    posterior: SizePosterior | None = None


@dataclass(frozen=True)
class Problem:
    """A recording, and the simulation of it with its parameters as stated.

    Attributes
    ----------
    recording: with inputs replaced by their conditional expectation
    simulation: what predicts the channel
    values: the simulation's parameters
    measured: the channel that is predicted, shape (time, wheel)
    prediction: the simulation's, NaN where it predicts nothing
    mask: where readings are compared
    left_out: what was measured and is not compared
    stated: the effects that the simulation was corrected by; `prediction` has them
    covariates: by the contract's names, each of shape (time, wheel)
    constants: what was measured but never varies, likewise: no effect shows in it, one that was corrected depends on it
    labels: what the covariates are called on this machine, with their units
    side, row: each wheel's place on the machine, or None
    thresholds: the numbers that decide
    made: what takes runs of the simulation, or long, by name and step: a cache, which copies of the problem share
    doubt: of the prediction by the inputs' stated errors; None: none is stated
    noise_size: by how much the noise's deviation grows with the predicted size, shape (time, wheel); None: it does not,
        or it is not known yet
    on_time: how late inputs were recorded that are put on time here [s], by name
    on_time_on: the wheels on which they are, by their indices, of those that are late on some
    as_recorded: where some are, the prediction from the inputs as they were recorded, without stated effects; None:
        `prediction` is of these
    late: how the predicted channel is late, by `late_columns.OF_CHANNEL`, and by how much [s]: what acts on the machine
        shows so much later; None: it is not, or it is not known yet
    late_on: the wheels, by their indices, on which it is late; empty: on all
    fed_back: covariates that follow the channel's noise: no curve over them explains anything
    held: parameters that stay at their values, as the recording would move them out of their bounds; and, by the names
        that `tangents` gives them, sizes of corrected effects
    smoothed: inputs that were replaced by their expectation, shape (time, wheel); empty where any was bridged as well
    at_once: whether friction is taken to reverse at once, however the recording shows it to
    unknown: initial states of runs, by their names, that are known no better than anything may be
    variant_value: the step of `secant` for variants of the simulation; None: the one that is asked for
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
    constants: Mapping[str, Array] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)
    left_out: tuple[LeftOut, ...] = ()
    stated: tuple[StatedEffect, ...] = ()
    thresholds: Thresholds = THRESHOLDS
    made: dict[tuple[str, float], Array] = field(default_factory=dict, repr=False)
    doubt: InputDoubt | None = None
    noise_size: Array | None = None
    on_time: Mapping[str, float] = field(default_factory=dict)
    on_time_on: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    as_recorded: Array | None = None
    late: tuple[str, float] | None = None
    late_on: tuple[int, ...] = ()
    fed_back: frozenset[str] = frozenset()
    held: frozenset[str] = frozenset()
    smoothed: Mapping[str, Array] = field(default_factory=dict, repr=False)
    at_once: bool = False
    unknown: frozenset[str] = frozenset()
    variant_value: float | None = None
    _derived: dict[str, Array] = field(default_factory=dict, init=False, repr=False, compare=False)
    """What was computed from covariates and readings, by name: a cache, which a copy begins anew."""
    _lately: RecentArrays = field(default_factory=RecentArrays, init=False, repr=False, compare=False)
    """The same of shapes that were tried last, the latest one last."""

    @property
    def time_s(self) -> Array:
        """Seconds from the first instant, shape (time, 1); one run after the other."""
        return self.covariates["time"][:, :1]

    @property
    def length_s(self) -> float:
        """From the first instant to the last [s]."""
        return float(self.time_s[-1, 0] - self.time_s[0, 0])

    @cached_property
    def arbitrary_zero(self) -> bool:
        """Whether nothing is in proportion to the predicted channel."""
        return zero_is_arbitrary(self.simulation, self.measured)

    @cached_property
    def reverses(self) -> bool:
        """Whether the machine moves backwards as well: else the sign of the speed says nothing."""
        return "direction" in self.covariates and bool((self.covariates["direction"] < 0).any())

    @cached_property
    def mean_size(self) -> float:
        """The predicted channel's mean magnitude: what effects are measured against.

        Of a channel with an arbitrary zero, a temperature in °C or K, it is the mean magnitude about each wheel's mean.
        """
        known = np.where(self.mask, self.measured, np.nan)[:, self.mask.any(axis=0)]
        centre = np.nanmean(known, axis=0) if self.arbitrary_zero else 0.0
        return float(np.nanmean(np.abs(known - centre)))

    @cached_property
    def filled(self) -> Array:
        """The prediction, 0 where there is none; what is late is computed from rows that are not compared, too."""
        return np.where(np.isfinite(self.prediction), self.prediction, 0.0)

    @cached_property
    def as_simulated(self) -> Array:
        """What the simulation predicts of the recording as it is, 0 where it predicts nothing: effects add to that."""
        if self.as_recorded is None:
            return self.filled
        delays = [effect.column for effect in self.stated if effect.on_time]
        return self._where_predicted(sum(delays, self.as_recorded + self.added))

    @cached_property
    def residual(self) -> Array:
        """What was measured less what the simulation predicts, 0 where it is not compared, shape (time, wheel)."""
        return np.where(self.mask, self.measured - self.as_simulated, 0.0)

    @cached_property
    def added(self) -> Array:
        """What stated effects add on the output of the simulation, shape (time, wheel)."""
        columns = [effect.column for effect in self.stated if not (effect.in_simulation or effect.on_time)]
        return sum(columns, np.zeros(self.mask.shape))

    @property
    def error_bias(self) -> Array | float:
        """What the inputs' errors add to the mean of the prediction, where that is curved in them."""
        return bias_of(self.doubt)

    @cached_property
    def courses(self) -> tuple[Readings, ...]:
        """Each wheel's compared readings, runs and gaps apart."""
        found = []
        for known in self.mask.T:
            rows = np.flatnonzero(known)
            steps = np.diff(rows)
            usual = float(np.median(steps)) if len(steps) else 1.0
            apart = (np.diff(self.recording.run[rows]) != 0) | (steps > LONGEST_BRIDGE * usual)
            starts = np.concatenate(([0], 1 + np.flatnonzero(apart), [len(rows)]))
            found.append((rows, tuple(slice(int(a), int(b)) for a, b in pairwise(starts) if b > a)))
        return tuple(found)

    def noise_of(self, residual: Array) -> NoiseModel:
        """Return the noise that a residual (time, wheel) shows."""
        direction = self.covariates.get("direction")
        moving = None if direction is None else self.known("direction") != 0
        return estimate_noise(residual, self.mask, self.thresholds, moving)

    @cached_property
    def wheel_sets(self) -> tuple[tuple[int, ...], ...]:
        """Sets of wheels, by their indices, that may share an effect beside all and each: a side, a row."""
        return tuple(self.simulation.wheel_sets(self.recording.wheels))

    def contrasts(self, covariate: str) -> Mapping[str, Array]:
        """Return factors (wheel,) by which a covariate acts oppositely on two parts of the machine, by name."""
        return self.simulation.contrasts(covariate, self.recording.wheels)

    @cached_property
    def free(self) -> tuple[str, ...]:
        """The parameters that are not exact, and not held at their values."""
        priors = self.simulation.parameters.items()
        return tuple(name for name, prior in priors if prior.std > 0 and name not in self.held)

    def has(self, *names: str) -> bool:
        """Return whether all these covariates were measured and vary."""
        return all(name in self.covariates for name in names)

    def known(self, covariate: str) -> Array:
        """Return a covariate, 0 where it is not known, shape (time, wheel)."""
        return self.once(f"known {covariate}", lambda: np.nan_to_num(self.covariates[covariate]))

    def once(self, name: str, derive: Callable[[], Array]) -> Array:
        """Return what is derived from covariates and readings, the first time that this name is asked for.

        All callers share the names: one says which quantity it is, and in which unit where that is not the covariate's.
        """
        if name not in self._derived:
            values = self._derived[name] = derive()
            values.setflags(write=False)  # whoever asks for it gets the same array
        return self._derived[name]

    def lately(self, name: Hashable, derive: Callable[[], Array], of: object = None) -> Array:
        """Return the same of what depends on a shape: only the latest are kept, since a search changes one number.

        `of` is what it belongs to, where the name does not tell.
        """
        return self._lately.get(of, name, derive)

    def run_once(self, name: str, step: float, run: Callable[[], Array]) -> Array:
        """Return what takes a run of the simulation, or long, the first time that this name and step are asked for."""
        if (name, step) not in self.made:
            self.made[name, step] = run()
        return self.made[name, step]

    def changes_within(self, values: Array) -> bool:
        """Return whether a factor (time, wheel) varies on a wheel as it moves, not only from wheel to wheel."""
        least = self.thresholds.least_change_within**2 * float(np.mean(values[self.mask] ** 2))
        return self.variance_within(values) > least

    def variance_within(self, values: Array) -> float:
        """Return a quantity's (time, wheel) variance on each wheel, averaged over the wheels where it is known."""
        known = self.mask & np.isfinite(values)
        counts = np.maximum(known.sum(axis=0), 1)
        away = np.where(known, values - np.where(known, values, 0.0).sum(axis=0) / counts, 0.0)
        return float(np.mean(((away**2).sum(axis=0) / counts)[known.any(axis=0)]))

    def changed(self, **changes: float) -> Array:
        """Return the prediction with parameters (or variants) set otherwise, 0 where `filled` has no prediction."""
        values = {**self._all_values, **changes}
        predicted = self.simulation.predict(complete_inputs(self.recording), values) + self.added + self.error_bias
        return self._where_predicted(predicted)

    def secant(self, name: str, step: float) -> Array:
        """Return the prediction's change per unit of a parameter or a variant, over a step from its value."""
        value = self._all_values[name]
        if self.variant_value is not None and name in self.simulation.variants():
            step = self.variant_value
        return self.run_once(name, step, lambda: (self.changed(**{name: value + step}) - self.filled) / step)

    def tangent_step(self, name: str) -> float:
        """Return the step of a parameter for a difference quotient."""
        return self.thresholds.tangent_step * (abs(self._all_values[name]) or 1.0)

    def tangent(self, name: str) -> Array:
        """Return ∂prediction/∂parameter, shape (time, wheel); of a simulation that switches see `principal_axes`."""
        along = self.run_once("tangents where it switches", 0.0, lambda: tangents_where_it_switches(self))
        return along[self.free.index(name)] if len(along) and name in self.free else self.difference_quotient(name)

    def difference_quotient(self, name: str, step: float | None = None) -> Array:
        """Return the prediction's change per unit of a parameter, over steps, small unless told, to both sides.

        By one alone, parameters whose products or quotients act would seem to be known each. Where one side has no
        prediction by the other alone; 0 where none has.
        """
        step = self.tangent_step(name) if step is None else step

        def mean_of_secants() -> Array:
            return known_mean(np.stack((self.secant(name, step), self.secant(name, -step))))

        return self.run_once(f"tangent {name}", step, mean_of_secants)

    def input_tangent(self, column: str) -> Array:
        """Return ∂prediction/∂ln(input), shape (time, wheel)."""
        step = self.thresholds.tangent_step

        def change() -> Array:
            moved = self.with_input(column, self.recording.channels[column] * (1 + step))
            return (moved - self.filled) / step

        return self.run_once("input " + column, step, change)

    def with_input(self, column: str, values: Array) -> Array:
        """Return the prediction for other readings of one input: see `with_inputs`."""
        return self.with_inputs({column: values})

    def with_inputs(self, readings: Mapping[str, Array]) -> Array:
        """Return the prediction for other readings of some inputs; as it is where there is none for these."""
        inputs = {**complete_inputs(self.recording), **readings}
        moved = self.simulation.predict(inputs, self._all_values) + self.added + self.error_bias
        return np.where(np.isfinite(moved), self._where_predicted(moved), self.filled)

    def _where_predicted(self, values: Array) -> Array:
        """Return a prediction, 0 where there is none, and NaN where it is compared and has no value."""
        return np.where(np.isfinite(self.prediction) & (self.mask | np.isfinite(values)), values, 0.0)

    @property
    def _all_values(self) -> dict[str, float]:
        """Parameters and variants."""
        return {**self.simulation.variants(), **self.values}
