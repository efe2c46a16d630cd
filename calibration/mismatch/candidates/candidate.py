"""The interface of a candidate: one physical effect that a simulation may leave out.

An effect is modelled as Σ coefficient × column, added to the predicted channel. The coefficients are fitted; the
columns are computed from the recording. What enters nonlinearly (an onset, a Stribeck speed) is a *shape parameter*:
the engine searches a grid of shapes and then optimises the continuous ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.tangents.fitted_variant import at_fitted_value, over_fitted_value

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.candidates.responses import Responses
    from regolithd.calibration.mismatch.problem.predictor import Predictor
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]
SHAPE_TOLERANCE = 0.02
"""Relative difference below which a fitted coefficient and the same number in its column agree (a choice: a fifth of
the usual 90 % interval; a smaller one costs iterations)."""
UNLIKELY_SHAPE_PENALTY = 9.2
"""Δχ² charged for a shape that has odds of one in a hundred before the recording: 2 ln 100."""
Shape = dict[str, float | str]
"""Values of the shape parameters by name. Numbers may be continuous (`free`), strings are kinds."""
Sharing = Literal["all", "one"]


NO_LOADS: Mapping[str, tuple[str, ...]] = {
    "temperature": ("°C", "degC", "K", "mK", "°F", "degF"),
    "place or angle": (
        *("m", "mm", "cm", "dm", "µm", "um", "km", "in", "inch", "ft", "yd", "mi"),
        *("rad", "mrad", "deg", "°", "arcmin", "arcsec", "rev", "turn", "turns"),
    ),
    "speed": (
        *("m/s", "mm/s", "cm/s", "m/min", "mm/min", "km/h", "mph", "ft/s", "ft/min", "in/s"),
        *("rad/s", "deg/s", "°/s", "rpm", "rps", "1/min", "r/min", "rev/min", "rev/s", "Hz"),
    ),
    "acceleration": (
        "m/s²",
        "mm/s²",
        "ft/s²",
        "rad/s²",
        "deg/s²",
        "°/s²",
        "m/s2",
        "mm/s2",
        "ft/s2",
        "rad/s2",
        "deg/s2",
    ),
    "content or flow": (
        *("l", "L", "ml", "mL", "m³", "m3", "gal", "ft³", "ft3"),
        *("m³/s", "m3/s", "m³/min", "m3/min", "m³/h", "m3/h", "l/s", "L/s", "l/min", "L/min", "l/h", "L/h"),
        *("ml/min", "mL/min", "gal/min", "gpm", "ft³/s", "ft3/s", "ft³/min", "ft3/min", "cfm"),
        *("kg/s", "kg/min", "kg/h", "t/h", "lb/s", "lb/min", "lb/h"),
    ),
}
"""Units of what a drive's load may change but is not made of, by quantity. Any other unit, a percentage or counts too,
may be that of a load."""
UNITS_OF_NO_LOAD = frozenset(unit for units in NO_LOADS.values() for unit in units)
OF_A_LOAD = "a predicted force, torque, pressure, current, voltage or power"
"""What an effect needs that is a load, in words."""


@dataclass(frozen=True)
class Coefficient:
    """A linear factor that is fitted.

    Attributes
    ----------
    name: as the answer's `parameters` has it
    unit: of the coefficient; `{unit}` stands for the unit of the predicted channel, `{per_speed}`, `{per_speed2}` and
        `{per_acceleration}` for one over that of `wheel_speed`, of its square and of its rate of change
    sign: +1 or −1 where physics allows one sign only, 0 for either
    """

    name: str
    unit: str = "{unit}"
    sign: int = 1


class Candidate:
    """One effect. Subclass it in a file of its own in this folder; nothing else has to be changed.

    The least that a subclass states: `name`, `covariate`, `equation`, `words`, `signature`, `experiment`, `source`,
    `coefficients` and `columns`. The other attributes and methods have defaults that suit a linear law.
    """

    name: ClassVar[str]
    """Identifier in the answer, in `[[effects]]` and in the documentation: lower case, words joined by hyphens."""
    covariate: ClassVar[str]
    """The quantity that the effect depends on: a key of `Problem.covariates` (`direction`, `wheel_speed`,
    `wheel_acceleration`, `wheel_angle`, `torque`, `time`, and what the simulation's `covariates` returns, such as
    `temperature`), `wheel_row`, or `none` for a constant. The report plots the residual against it; `experiment` has
    to vary it."""
    equation: ClassVar[str]
    """The law, as text, for the answer and the report."""
    words: ClassVar[str]
    """A noun phrase in lower case that begins the answer's sentence: "drag that grows with speed". A covariate in
    braces is replaced as in `experiment`."""
    signature: ClassVar[str]
    """What the effect looks like in a residual, for the documentation."""
    experiment: ClassVar[str]
    """An instruction in the imperative, lower case, without a full stop: how to vary what `vary` names, and nothing
    else. The answer gives it where this effect cannot be told from another. A covariate in braces, `{wheel_speed}`, is
    replaced by what the user's machine calls it."""
    experiment_one_way: ClassVar[str] = ""
    """The same for a machine that runs one way only; by default `experiment`."""
    vary: ClassVar[tuple[str, ...]] = ()
    """The covariates that the experiment varies, for programs; by default `covariate`."""
    run_unloaded: ClassVar[bool] = False
    """Whether the experiment has a part without load: what the load does is absent there, this effect or its like is
    not."""
    source: ClassVar[str]
    """Where the form of the law and the usual size come from: author and year, data sheet, or the law of physics."""
    coefficients: ClassVar[tuple[Coefficient, ...]]
    """One for each column, in the order of the columns; `columns` may return fewer, where the machine lacks one."""

    imitated_over: ClassVar[str] = ""
    """The covariate over which a smooth curve can imitate the effect, by default `covariate`; `none` where no curve
    can, as what follows how fast a channel changes is a function of no covariate."""
    forms: ClassVar[tuple[str, ...]] = ()
    """Names of the law's forms, where it has several that differ in more than a number: "dead time". A name stands in
    brackets after `words`; `form_of` tells which one a shape has."""
    label: ClassVar[str] = ""
    """The name as text for people; by default `name` with its last hyphen as a space: "multi-pass compaction"."""
    parameter_labels: ClassVar[Mapping[str, str]] = {}
    """Labels for the report's table of parameters; by default a parameter's name with spaces."""
    requires: ClassVar[tuple[str, ...]] = ()
    """Covariates that must have been recorded and vary; without them the candidate is not looked for."""
    needs: ClassVar[str] = ""
    """What `applies` asks for beside `requires`, as a noun phrase: "a predicted current"; by default nothing, or
    `OF_A_LOAD` where the effect `loads` a drive."""
    sharing: ClassVar[tuple[Sharing, ...]] = ("all", "one")
    """Wheels that may have the effect: `all` with the same coefficients, or `one` alone."""
    channel: ClassVar[str | None] = None
    """The faulty channel, where that is not the predicted one (a load cell); None: the predicted channel."""
    along_motion: ClassVar[bool] = True
    """Whether the effect changes sign with the direction of motion, as a drag does. The report multiplies the residual
    by the sign of the speed if it does, and shows it as it is otherwise."""
    free: ClassVar[Mapping[str, tuple[float, float]]] = {}
    """Continuous shape parameters with their least and greatest value. The ending of the name is the unit: `_s`, `_K`,
    `_degC`, `_rad_s`; without one of these it has none."""
    refined: ClassVar[Mapping[str, tuple[float, float]]] = {}
    """Further numbers of a shape, with their least and greatest value. They have usual values, those in the grid: the
    engine moves away from these only where a recording demands it. The ending of a name is its unit, as of `free`."""
    scaled_by: ClassVar[str] = ""
    """The shape parameter that multiplies the columns, where there is one: a coefficient makes up for it."""
    shape_keys: ClassVar[Mapping[str, str]] = {}
    """What each key of its shapes means, for the documentation: `shape` of the answer and of `[[effects]]`."""
    shape_priors: ClassVar[Mapping[str, tuple[float, float]]] = {}
    """Mean and standard deviation of those of them that are known before the recording."""
    late_with_channel: ClassVar[bool] = True
    """Whether it shows later where the predicted channel is late: all do but the delay itself."""
    stated_size: ClassVar[float] = 0.0
    """The coefficient that the prediction has already: that of a change of a corrected effect is relative to it."""
    change_point: ClassVar[str] = "onset_s"
    """The shape parameter, where a candidate has it, that is the time at which the effect begins. Its Δχ² is no smooth
    function of it, so that it has an interval of its own."""
    once_begun: ClassVar[str] = ""
    """Name of the effect in the library that this one is after its onset, where there is one: a drag is a friction."""
    wanders: ClassVar[bool] = False
    """Whether the effect takes a random course after its onset, so that no shape is ever exact."""
    loads: ClassVar[bool] = False
    """Whether the effect is a force or a torque on a drive. It is told in the predicted channel's unit, and is not
    looked for where that is no force, torque, or what a drive takes for one (current, voltage, power, pressure)."""
    units: ClassVar[frozenset[str]] = frozenset()
    """Units of the predicted columns in which it is looked for, where these are few; empty: any, or any of a load."""
    acts_unloaded: ClassVar[bool] = True
    """Whether the effect is there with the wheels lifted, where soil and load have no part in the channel."""

    def __init_subclass__(cls) -> None:
        """Derive the label from the name, and other attributes that follow from those that are stated."""
        super().__init_subclass__()
        if cls.loads and not cls.needs:
            cls.needs = OF_A_LOAD
        if "name" in vars(cls) and "label" not in vars(cls):
            cls.label = " ".join(cls.name.rsplit("-", 1)).replace("_", " ")
        if "covariate" in vars(cls) and "vary" not in vars(cls):
            cls.vary = () if cls.covariate == "none" else (cls.covariate,)
        if "covariate" in vars(cls) and "imitated_over" not in vars(cls):
            # The curve over speed, along the motion, holds a constant drag.
            cls.imitated_over = "wheel_speed" if cls.covariate == "direction" else cls.covariate

    def form_for(self, simulation: Predictor) -> Candidate:  # noqa: ARG002  # subclasses look
        """Return the candidate in the form that it has for a simulation; by default it has only one."""
        return self

    def coefficients_here(self, problem: Problem, shape: Shape, found: Sequence[float]) -> Sequence[float]:  # noqa: ARG002
        """Return a corrected effect's coefficients as it acts in this recording; by default as they were found."""
        return found

    def beside(self, corrected: Sequence[Shape]) -> Candidate | None:  # noqa: ARG002  # subclasses look
        """Return what is still looked for where the simulation was corrected by this effect on all wheels.

        Parameters
        ----------
        corrected: the shapes that it has there; None comes back where only a change of these is left to look for
        """
        return None

    def words_for(self, shape: Shape) -> str:  # noqa: ARG002  # subclasses look
        """Return the words for one shape, where that says more (which channel is late); by default `words`."""
        return self.words

    def words_with(self, shape: Shape, values: Mapping[str, float]) -> str:  # noqa: ARG002  # subclasses look
        """Return the words for one shape and its fitted coefficients by name; by default `words_for`."""
        return self.words_for(shape)

    def form_of(self, shape: Shape) -> str:  # noqa: ARG002  # subclasses look
        """Return which of `forms` a shape has; empty where the law has only one."""
        return ""

    def instruction(self, simulation: Predictor) -> str:
        """Return the experiment for a simulation's machine: that of a machine that runs one way, where it does."""
        return (simulation.one_way and self.experiment_one_way) or self.experiment

    def varied(self, problem: Problem) -> tuple[str, ...]:  # noqa: ARG002  # subclasses look
        """Return the covariates that the experiment varies on this machine; by default `vary`."""
        return self.vary

    def applies(self, problem: Problem) -> bool:
        """Return whether this recording and simulation allow the effect at all."""
        return problem.has(*self.requires) and self.acts_in(problem.simulation.unit)

    def acts_in(self, unit: str) -> bool:
        """Return whether the effect can be in a predicted column with this unit."""
        return (unit in self.units if self.units else True) and not (self.loads and unit in UNITS_OF_NO_LOAD)

    def shapes(self, problem: Problem) -> Sequence[Shape]:  # noqa: ARG002  # subclasses use it
        """Return the grid of shapes to search; empty where shapes come from `propose_shapes` alone."""
        return [{}]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return the columns for one shape.

        Parameters
        ----------
        problem: recording, calibrated prediction (`problem.filled`) and covariates, each of shape (time, wheel)
        shape: one of `shapes`, or one with its `free` parameters moved within `bounds`

        Returns
        -------
        Array of shape (column, time, wheel), finite wherever `problem.mask` is set: the change of the predicted
        channel for a coefficient of 1. One column for each of `coefficients`. A corrected simulation keeps shape and
        coefficients: what a column is scaled by (a mean, the coldest temperature) belongs in the shape, so that it is
        the same law in any other recording.
        """
        raise NotImplementedError

    def bounds(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:  # noqa: ARG002
        """Return the range of each free shape parameter that this recording can tell; by default `free`.

        A free parameter that is not a key of `shape` is left alone.
        """
        return self.free

    def refinable(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:  # noqa: ARG002
        """Return the range of each number of a shape that a recording may move away from its usual values."""
        return {name: ends for name, ends in self.refined.items() if name in shape}

    def unusual(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:
        """Return the range of each number of a shape that was moved away from its usual values."""
        return {
            name: ends
            for name, ends in self.refinable(problem, shape).items()
            if not np.isclose(float(shape[name]), self._usual(problem, name), rtol=1e-9).any()
        }

    def _usual(self, problem: Problem, name: str) -> Array:
        """Return the values that a number of a shape has in the grid, which is asked for with each shape of it."""

        def of_grid() -> Array:
            return np.array([float(shape[name]) for shape in self.shapes(problem) if name in shape])

        return problem.once(f"usual {name} of {self.name}, {type(self).__qualname__}", of_grid)

    def continuous(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:
        """Return the range of each number of a shape that was fitted: those that are free, and unusual values."""
        return {**self.bounds(problem, shape), **self.unusual(problem, shape)}

    def search_range(
        self, problem: Problem, shape: Shape, name: str, bounds: tuple[float, float]
    ) -> tuple[float, float]:
        """Return where to optimise a free shape parameter: about its value, to the neighbouring points of a grid."""
        limits, at, (low, high) = problem.thresholds, float(shape[name]), bounds
        if name == self.change_point:
            reach = limits.onset_reach * problem.length_s
        else:
            reach = limits.shape_reach * max(abs(at), limits.shape_reach_floor * (high - low))
        return max(low, at - reach), min(high, at + reach)

    def parameters(self, shape: Shape, values: Sequence[float]) -> dict[str, float]:
        """Return what the answer reports, by name: the coefficients' values and the free shape parameters.

        Raises
        ------
        ValueError
            When there are more columns than coefficients.
        """
        names = [coefficient.name for coefficient in self.coefficients[: len(values)]]
        found = {name: float(value) for name, value in zip(names, values, strict=True)}
        # A step has no time constant, and a constant share no power: 0 stands for neither.
        numbers = [*self.free, *(name for name in self.refined if shape.get(name))]
        return {**found, **{name: float(shape[name]) for name in numbers if name in shape}}

    def prior_penalty(self, problem: Problem, shape: Shape) -> float:  # noqa: ARG002
        """Return the Δχ² that a shape must gain beyond others, for contradicting what was known before."""
        return sum(((float(shape[name]) - mean) / std) ** 2 for name, (mean, std) in self.shape_priors.items())

    def plausible(self, problem: Problem, shape: Shape, values: Sequence[float]) -> bool:  # noqa: ARG002
        """Return whether fitted coefficients are possible; their signs are tested before."""
        return True

    def without_covariate(self, shape: Shape) -> Shape | None:  # noqa: ARG002
        """Return the shape of the same law without its dependence on the covariate, if there is one to be held against.

        A term must gain more than that by as much as its shapes cost.
        """
        return None

    def self_consistent_shape(self, problem: Problem, shape: Shape, values: Sequence[float]) -> Shape:
        """Return the shape that agrees with its fitted coefficients `values`, where the law is not linear in them.

        The engine alternates this with the fit until the shape stays the same. By default the change by a variant of
        the simulation, where the column is that, is taken over the fitted value.
        """
        if not problem.simulation.variants():
            return shape
        columns = self.columns(over_fitted_value(problem, shape), shape)
        return at_fitted_value(problem, shape, values, columns, SHAPE_TOLERANCE)

    def resolution(self, problem: Problem) -> float:  # noqa: ARG002
        """Return within how much of a shape parameter the columns' slope with it may jump: one is taken across it."""
        return 0.0

    def stated_coefficient(self, shape: Shape) -> tuple[float, float] | None:  # noqa: ARG002
        """Return the coefficient at which a shape is exact, and its relative standard deviation, where it states one.

        The shape is then optimised with that as the coefficient's prior.
        """
        return None

    def shape_at(self, shape: Shape, value: float) -> Shape:  # noqa: ARG002
        """Return the shape whose column has the stated coefficient, when it was fitted with `value`."""
        return shape

    def onset_profiles(self, problem: Problem) -> Sequence[Shape]:
        """Return how the effect may develop after its onset, for the onset's interval: by default as in the search."""
        return self.developments(problem)

    def developments(self, problem: Problem) -> Sequence[Shape]:
        """Return how the search lets the effect develop: every distinct shape of the grid without its `onset_s`."""
        found = {tuple(sorted((k, v) for k, v in s.items() if k != "onset_s")) for s in self.shapes(problem)}
        return [dict(profile) for profile in sorted(found, key=str)]

    def shape_count(self, problem: Problem) -> float:
        """Return how many distinct shapes the search chooses from: 2 ln of it is the penalty for that choice."""
        return max(len(self.shapes(problem)), 1)

    def left_open(self, problem: Problem, name: str) -> float:  # noqa: ARG002
        """Return the standard deviation of a shape parameter that no recording could reduce."""
        return 0.0

    def propose_shapes(self, problem: Problem, residual: Array) -> Sequence[Shape]:  # noqa: ARG002
        """Return shapes suggested by a residual [time, wheel], where a grid would have to be too fine."""
        return []

    def autocorrelation_time_at(self, problem: Problem, residual: Array, shape: Shape) -> float:  # noqa: ARG002
        """Return the noise's autocorrelation time [readings] at the frequencies of this shape's columns.

        Infinite where only that of slow changes is known, which is the default.
        """
        return float("inf")

    def own_channel_evidence(self, problem: Problem, shape: Shape) -> tuple[Array, Array] | None:  # noqa: ARG002
        """Return Δχ² and coefficient of the fault in its own `channel`, shape (wheel,) each; None: there is no such."""
        return None

    def columns_of_wheels(self, shape: Shape, wheels: int) -> NDArray[np.int64] | None:  # noqa: ARG002
        """Return the places of each wheel's columns, shape (wheel, column), where each has coefficients of its own.

        None: the wheels that share the effect share its coefficients.
        """
        return None

    def responses(self, problem: Problem, residual: Array) -> Responses | None:  # noqa: ARG002
        """Return what a residual [time, wheel] has of shapes with the same coefficients in all recordings of a machine.

        Of shapes that a residual proposes, those of a fleet are found so; None: there are none.
        """
        return None
