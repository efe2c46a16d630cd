"""How friction reverses in a recording: at once, with the speed, or with the displacement since the reversal."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import inf
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.friction_laws import (
    Decay,
    about_reversals,
    decaying_drag,
    friction_laws,
)
from regolithd.calibration.mismatch.candidates.late_columns import as_shown
from regolithd.calibration.mismatch.candidates.motion import PRESLIDING, TRANSITION, along_motion, displacement_of
from regolithd.calibration.mismatch.candidates.wheel_angle_ripple import WheelAngleRipple
from regolithd.calibration.mismatch.problem.covariates import USUAL_SPEED_QUANTILE
from regolithd.calibration.mismatch.signal.chi_squared import quantile
from regolithd.calibration.mismatch.signal.least_squares import fitted, squares_left
from regolithd.calibration.mismatch.signal.noise_models.whitening import NOT_WHITENED, Whitening, estimate_whitening

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Shape
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

KEYS = (TRANSITION, PRESLIDING)
"""Numbers of a shape that a reversal has."""
TRANSITIONS = (0.0025, 0.005, 0.01, 0.02, 0.04)
"""Speeds at which the friction has reversed by three quarters, as shares of the highest usual speed (a choice: from
where it is a step for most readings to where it would be taken for viscous friction); the best is refined between its
neighbours."""
DECAYS = (0.05, 0.1, 0.2, 0.4)
"""Speeds over which friction that decays from standstill does, as shares of the highest usual speed (a choice: from
where the slowest reversals are)."""
DECAY_POWERS = (1, 2)
"""Exponents of that: an exponential, and a Gaussian."""
DISPLACEMENTS = (0.005, 0.01, 0.02, 0.04, 0.08, 0.16)
"""Displacements after which all but 1/e has reversed, as shares of the usual one from a reversal to the next (a choice,
as above)."""
FEWEST_REVERSALS = 8
"""Reversals of an axis from which a displacement is looked for (a choice: one may be a stop)."""
REFINED_TO = 0.05
"""Relative tolerance of the refined shape (a choice: its effect on the residual is of second order)."""
FIRST_STEP = 0.35
"""First step of the search for the shape, in natural logarithms (a choice: half of the way to the next that is tried).
"""
PROMISING = 0.5
"""Share of the Δχ² that is needed, from which a shape is refined (a choice)."""
COARSE = 0.01
"""Share of the Δχ² of friction that a shape may lose which is not refined (of a joint with little noise it was 0.0009
and 0.0016 at two linearisations)."""
MOST_EVALUATIONS = 40
"""Of that search, at most (a choice: one number takes 10, two take 25)."""
MOST_KEPT = 3
"""Shapes of which the columns are kept (a choice: the step, the best, and the one that is tried)."""
LEAST_WITHIN = 0.01
"""Share of the readings in motion that must be within a reversal, to tell it from a step (a choice)."""
TURNED = 0.75
"""Share of the friction that has reversed where a reading is no more within a reversal: tanh 1."""


def reversal_of(problem: Problem) -> Shape:
    """Return the shape that explains this recording's friction better than a step does, empty where none does."""
    return _reversal(problem, lambda: _best_reversal(problem))


def keep_reversal(problem: Problem, known: Shape) -> None:
    """Keep what `reversal_of` returned of the same recording before, so that it is not computed again."""
    _reversal(problem, lambda: known)


def _reversal(problem: Problem, found: Callable[[], Shape]) -> Shape:
    if problem.at_once:
        return {}

    def values() -> Array:
        best = found()
        return np.array([float(best.get(key, 0.0)) for key in KEYS])

    # Copies of a problem share what was run once, and a copy may be late where the problem is not.
    once = problem.run_once(f"reversal of the friction, late by {problem.late} on {problem.late_on}", 0.0, values)
    return {key: float(value) for key, value in zip(KEYS, once, strict=True) if value}


def _best_reversal(problem: Problem) -> Shape:
    if not problem.has("wheel_speed", "direction") or not any(_reversals(problem)):
        return {}
    moving = problem.mask & (problem.known("direction") != 0)
    tried = [shape for shape in _shapes(problem) if _share_within(problem, shape, moving) > LEAST_WITHIN]
    if not tried:
        return {}
    beside = _beside_a_step(problem)
    if not beside.squares_left({}) > 0:
        return {}  # a drive that was simulated without noise
    found = _gradual(beside, tried)
    if found and (ripple := _ripple(beside, found)):
        found = _gradual(_beside_a_step(problem, ripple), tried)
    return found


def _gradual(beside: _Beside, tried: Sequence[Shape]) -> Shape:
    """Return the best shape where it explains friction better than a step does, empty where none does.

    It is refined where those that are tried come near that.
    """
    level = beside.problem.thresholds.single_test_level
    # For friction of any law, and for the number that a gradual reversal has, and a step has not.
    of_any_law, of_reversal = quantile(beside.laws, level), quantile(1, level)
    _, of_friction, ahead = _compared(beside, tried, of_reversal, _as_tried)
    if of_friction < PROMISING * of_any_law or ahead + COARSE * of_friction < PROMISING * of_reversal:
        return {}
    shape, of_friction, ahead = _compared(beside, tried, of_reversal, _refined)
    return shape if of_friction > of_any_law and ahead > of_reversal else {}


def _compared(
    beside: _Beside, tried: Sequence[Shape], needed: float, refined: Callable[[_Beside, Shape], _Turn]
) -> tuple[Shape, float, float]:
    """Return the best shape, the Δχ² of friction with it, and by how much that is ahead of friction with a step.

    Drag near standstill that decays with speed resembles a gradual reversal, with as many numbers, or hides how gradual
    it is: both are held against each other beside it, too, where it has the Δχ² that is needed.
    """
    step, gradual = _Turn({}, beside.squares_left({})), _best_of(beside, tried, refined)
    decaying_step = _with_decay(beside, {}, refined)
    others = (gradual.shape, _best_of(replace(beside, decay=decaying_step.decay), tried, refined).shape)
    decaying = min((_with_decay(beside, shape, refined) for shape in others), key=lambda turn: turn.left)
    if beside.gain(min(decaying_step.left, decaying.left), gradual.left) > needed:
        step, gradual = decaying_step, decaying
    of_friction = beside.independent * (beside.squares_without_friction / gradual.left - 1)
    return gradual.shape, of_friction, beside.gain(gradual.left, step.left)


def _ripple(beside: _Beside, shape: Shape) -> list[Array]:
    """Return columns of a ripple in the wheel angle beside friction that reverses so, empty where there is none.

    Of a machine that turns round at the same places a ripple has the same course after each reversal, as friction that
    follows the displacement has.
    """
    problem, candidate = beside.problem, WheelAngleRipple()
    if not problem.has("wheel_angle"):
        return []
    left = beside.left_as_read(shape)
    proposed = [candidate.columns(problem, each) for each in candidate.propose_shapes(problem, left)]
    tried = [(beside.with_free(columns).squares_left(shape), columns) for columns in proposed]
    least, columns = min(tried, key=lambda pair: pair[0], default=(inf, np.zeros(0)))
    needed = quantile(len(columns), problem.thresholds.single_test_level / candidate.shape_count(problem))
    return list(columns) if beside.gain(least, beside.squares_left(shape)) > needed else []


def _best_of(beside: _Beside, tried: Sequence[Shape], refined: Callable[[_Beside, Shape], _Turn]) -> _Turn:
    """Return the best of these shapes, the best of each kind refined."""
    of_kind = {next(iter(shape)): shape for shape in sorted(tried, key=beside.squares_left, reverse=True)}
    return min((refined(beside, shape) for shape in of_kind.values()), key=lambda turn: turn.left)


def _with_decay(beside: _Beside, shape: Shape, refined: Callable[[_Beside, Shape], _Turn]) -> _Turn:
    """Return the best of the drags that decay from standstill, beside friction that reverses with a shape like this."""
    usual = _usual_speed(beside.problem)
    tried = [replace(beside, decay=Decay(share * usual, power)) for share in DECAYS for power in DECAY_POWERS]
    return refined(min(tried, key=lambda each: each.squares_left(shape)), shape)


def _shapes(problem: Problem) -> Iterator[Shape]:
    """Yield what is tried: speeds, and displacements where the machine reverses often enough."""
    usual = _usual_speed(problem)
    for share in TRANSITIONS if usual > 0 else ():
        yield {TRANSITION: share * usual}
    displacement = displacement_of(problem)
    travelled = np.where(np.isfinite(displacement), displacement, 0.0).sum(axis=0)
    of_axes = zip(travelled.tolist(), _reversals(problem), strict=True)
    swings = [way / reversals for way, reversals in of_axes if reversals >= FEWEST_REVERSALS]
    for share in DISPLACEMENTS if swings else ():
        yield {PRESLIDING: share * float(np.median(swings))}


def _reversals(problem: Problem) -> list[int]:
    """Return how often each axis reverses."""
    return [int(np.count_nonzero(np.diff(turned[turned != 0]))) for turned in problem.known("direction").T]


def _usual_speed(problem: Problem) -> float:
    """Return the highest usual speed, 0 where nothing moves."""
    speed = np.abs(problem.covariates["wheel_speed"][problem.mask])
    return float(np.nanquantile(speed[speed > 0], USUAL_SPEED_QUANTILE)) if (speed > 0).any() else 0.0


def _share_within(problem: Problem, shape: Shape, moving: NDArray[np.bool_]) -> float:
    """Return which share of the readings in motion is within a reversal."""
    along = along_motion(problem, shape) * problem.known("direction")
    return float(np.mean(along[moving] < TURNED)) if moving.any() else 0.0


@dataclass(frozen=True)
class _Turn:
    """How friction may reverse: its shape, the sum of squares that is left, and what decays beside it, if anything."""

    shape: Shape
    left: float
    decay: Decay | None = None


@dataclass(frozen=True, eq=False)
class _Beside:
    """A recording, whitened by the noise that friction which reverses at once leaves.

    How friction reverses shows within moments of each reversal, in what noise with a memory hardly hides.

    Attributes
    ----------
    problem: the recording's
    as_read: columns of the free parameters, and of what else acts about reversals, shape (time, wheel) each
    whitening, deviation: of that noise; its standard deviation has the shape (wheel,)
    independent: as many independent readings know as much as all whitened ones
    free: the same columns whitened, shape (column, reading)
    residual: shape (1, reading)
    laws: how many friction may follow
    decay: drag that decays from standstill among them; None: none
    made: columns of the other laws, and products of all, by the shape with which they reverse, of the last few
    known: sums of squares that were asked for, by shape and decay
    """

    problem: Problem
    as_read: list[Array]
    whitening: Whitening
    deviation: Array
    independent: float
    free: Array
    residual: Array
    laws: int
    decay: Decay | None = None
    made: dict[tuple[tuple[str, object], ...], tuple[Array, Array]] = field(default_factory=dict)
    known: dict[tuple[tuple[tuple[str, object], ...], Decay | None], float] = field(default_factory=dict)

    def gain(self, left: float, step: float) -> float:
        """Return the Δχ² of what leaves one sum of squares over what leaves another."""
        return self.independent * (1 - left / step)

    @property
    def squares_without_friction(self) -> float:
        """Return the sum of squares that the free parameters alone leave."""
        return squares_left(self._products(self.free, self.residual))[0]

    def squares_left(self, shape: Shape) -> float:
        """Return the sum of squares that the free parameters and friction of any usual law leave, with this shape.

        What decays from standstill is drag beyond the other laws: less drag there would be a gradual reversal.
        """
        key = tuple(shape.items()), self.decay
        if key not in self.known:
            self.known[key] = self._squares_left(shape)
        return self.known[key]

    def _squares_left(self, shape: Shape) -> float:
        laws, products = self._laws_of(shape)
        if self.decay is None:
            return squares_left(products)[0]
        drag = decaying_drag(self.problem, shape, self.decay)
        decaying = _in_order(self.problem, [drag], self.whitening, self.deviation)
        beside = np.concatenate([each @ decaying[0] for each in (self.free, laws, decaying, self.residual)])
        at = len(self.free) + len(laws)
        with_decay = np.insert(np.insert(products, at, 0.0, axis=0), at, 0.0, axis=1)
        with_decay[at], with_decay[:, at] = beside, beside
        left, coefficient = squares_left(with_decay)
        return left if coefficient >= 0 else squares_left(products)[0]

    def left_as_read(self, shape: Shape) -> Array:
        """Return what they and friction with this shape leave of the readings, shape (time, wheel)."""
        left = np.zeros(self.problem.mask.shape)
        parts = _by_wheel(
            self.problem, _left_as_read(self.problem, [*self.as_read, *friction_laws(self.problem, shape)])
        )
        for wheel, ((rows, _), part) in enumerate(zip(self.problem.courses, parts, strict=True)):
            left[rows, wheel] = part
        return left

    def with_free(self, columns: Array) -> _Beside:
        """Return the same with further columns (column, time, wheel) beside the free parameters."""
        further = _in_order(self.problem, list(columns), self.whitening, self.deviation)
        return replace(self, free=np.concatenate((self.free, further)), made={}, known={})

    def _products(self, *columns: Array) -> Array:
        """Return the products of columns, shape (column, reading), with each other."""
        return np.block([[one @ other.T for other in columns] for one in columns])

    def _laws_of(self, shape: Shape) -> tuple[Array, Array]:
        """Return the columns of all laws but one that decays, whitened, shape (column, reading), and products of all.

        The products are those of the free columns, the laws and the residual, which is last.
        """
        key = tuple(shape.items())
        if key not in self.made:
            while len(self.made) >= MOST_KEPT:
                del self.made[next(iter(self.made))]
            laws = _in_order(self.problem, friction_laws(self.problem, shape), self.whitening, self.deviation)
            self.made[key] = laws, self._products(self.free, laws, self.residual)
        return self.made[key]


def _beside_a_step(problem: Problem, further: Sequence[Array] = ()) -> _Beside:
    """Return the recording beside friction that reverses at once, the free parameters, and `further` columns."""
    parameters = [problem.tangent(name) for name in problem.free]
    free = [*as_shown(problem, [*parameters, *about_reversals(problem)]), *further]
    residual, laws = problem.residual, friction_laws(problem, {})
    parts = _by_wheel(problem, _left_as_read(problem, [*free, *laws]))
    deviation = np.array([np.sqrt(np.mean(part**2)) if part.size else 0.0 for part in parts])
    deviation = np.where(deviation > 0, deviation, 1.0)
    courses = [
        (part / of_wheel, runs)
        for part, of_wheel, (_, runs) in zip(parts, deviation, problem.courses, strict=True)
        if part.any()
    ]
    whitening = estimate_whitening(courses, problem.thresholds)
    white = np.zeros(residual.shape)
    for wheel, ((rows, runs), part) in enumerate(zip(problem.courses, parts, strict=True)):
        white[rows, wheel] = whitening.apply(part / deviation[wheel], runs)
    return _Beside(
        problem,
        free,
        whitening,
        deviation,
        float(problem.mask.sum()) / problem.noise_of(white).autocorrelation_time,
        _in_order(problem, free, whitening, deviation),
        _in_order(problem, [residual], whitening, deviation),
        len(laws),
    )


def _in_order(problem: Problem, columns: Sequence[Array], whitening: Whitening, deviation: Array) -> Array:
    """Return columns (time, wheel) over the noise's deviation, whitened, shape (column, reading): wheel by wheel."""
    parts = []
    for wheel, (rows, runs) in enumerate(problem.courses):
        values = np.array([column[rows, wheel] for column in columns]).reshape(len(columns), -1)
        parts.append(whitening.apply(values / deviation[wheel], runs))
    return np.concatenate(parts, axis=1)


def _by_wheel(problem: Problem, values: Array) -> list[Array]:
    """Return values (reading,) that are in order, of each wheel."""
    return list(np.split(values, np.cumsum([len(rows) for rows, _ in problem.courses])[:-1]))


def _left_as_read(problem: Problem, columns: Sequence[Array]) -> Array:
    """Return what columns (time, wheel) leave of the residual by least squares, shape (reading,): wheel by wheel."""
    ones = np.ones(problem.mask.shape[1])
    residual, *in_order = _in_order(problem, [problem.residual, *columns], NOT_WHITENED, ones)
    by = np.reshape(in_order, (len(columns), -1))
    return np.asarray(residual - fitted(by @ by.T, by @ residual) @ by)


def _as_tried(beside: _Beside, shape: Shape) -> _Turn:
    """Return this shape, and decay."""
    return _Turn(shape, beside.squares_left(shape), beside.decay)


def _refined(beside: _Beside, shape: Shape) -> _Turn:
    """Return the best shape, and decay, with each number between half and twice this one's."""
    from scipy.optimize import minimize  # noqa: PLC0415  # most recordings need none, and no SciPy for it

    def at(point: Array) -> tuple[_Beside, Shape]:
        numbers = iter(np.exp(point).tolist())
        moved = {name: next(numbers) for name in shape}
        decay = beside.decay and replace(beside.decay, speed=next(numbers))
        return replace(beside, decay=decay), moved

    start = np.log([float(value) for value in shape.values()] + ([beside.decay.speed] if beside.decay else []))
    simplex = np.vstack((start, start + FIRST_STEP * np.eye(len(start))))
    found = minimize(
        lambda point: at(point)[0].squares_left(at(point)[1]),
        start,
        method="Nelder-Mead",
        bounds=[(value - np.log(2), value + np.log(2)) for value in start],
        options={"xatol": REFINED_TO, "fatol": np.inf, "maxfev": MOST_EVALUATIONS, "initial_simplex": simplex},
    )
    best, moved = at(found.x)
    return _Turn(moved, float(found.fun), best.decay)
