"""The direction of motion, as laws of friction depend on it: a step at standstill, or a smooth transition about it.

Dry friction does not turn round at once: before it slides, a contact yields (presliding), and a speed that is measured
with noise or averaged over a reading crosses zero gradually. How slow "slow" is belongs to the machine, not to one law,
so it is found once for a recording and stands in the shape of each law that reverses.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.covariates import USUAL_SPEED_QUANTILE
from regolithd.calibration.mismatch.signal.whitening import NOT_WHITENED, Whitening, estimate_whitening

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Shape
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

TRANSITION = "transition_rad_s"
"""The shape parameter of a law that reverses: the speed at which the friction has turned round by three quarters."""
TRANSITION_KEY = {
    TRANSITION: "ω_t of a friction that turns round gradually: its law times tanh(|ω|/ω_t) (without the key: at once)"
}
"""What the key means, for the documentation."""
TRANSITIONS = (0.0025, 0.005, 0.01, 0.02, 0.04)
"""Speeds at which the friction has turned round by three quarters, as shares of the highest usual speed (a choice: from
where it is a step for most readings to where it would be taken for viscous friction); the best is refined between its
neighbours."""
REFINED_TO = 0.05
"""Relative tolerance of the refined transition (a choice: its effect on the residual is of second order)."""
LEAST_WITHIN = 0.01
"""Share of the readings in motion that must be within a transition, to tell it from a step (a choice)."""
LEAST_GAIN = 10.8
"""Δχ² from which a transition is preferred to a step: one chance in a thousand for one more coefficient."""
SINGULAR = 1e-12
"""Relative singular value of the products below which laws are the same (a choice: double precision, with a margin)."""


def transition_of(problem: Problem) -> Shape:
    """Return the transition that explains this recording's friction better than a step does, empty where none does."""
    speed = float(problem.run_once("transition of the direction", 0.0, lambda: np.array(_best_transition(problem))))
    return {TRANSITION: speed} if speed else {}


def along_motion(problem: Problem, shape: Shape) -> Array:
    """Return sign(ω), or tanh(ω/ω_t) where the shape has a transition, 0 at standstill, shape (time, wheel)."""
    direction = problem.known("direction")
    if TRANSITION not in shape:
        return np.asarray(direction)
    speed = np.abs(problem.known("wheel_speed"))
    return np.asarray(direction * np.tanh(speed / float(shape[TRANSITION])))


def _best_transition(problem: Problem) -> float:
    if not problem.has("wheel_speed", "direction"):
        return 0.0
    speed = np.abs(problem.covariates["wheel_speed"][problem.mask])
    moving = speed[speed > 0]
    widths = (
        [share * float(np.nanquantile(moving, USUAL_SPEED_QUANTILE)) for share in TRANSITIONS] if moving.size else []
    )
    widths = [width for width in widths if np.mean(moving < width) > LEAST_WITHIN]
    if not widths:
        return 0.0
    beside = _beside_a_step(problem)
    step = beside.squares_left({})
    best, left = _refined(beside, min(widths, key=beside.squares_within))
    gain = beside.independent * (1 - left / max(step, 1e-300))
    return best if gain > LEAST_GAIN else 0.0


@dataclass(frozen=True, eq=False)
class _Beside:
    """A recording, whitened by the noise that friction which reverses at once leaves.

    A transition shows within moments of each reversal, in what noise with a memory hardly hides.

    Attributes
    ----------
    problem: the recording's
    whitening, deviation: of that noise; its standard deviation has the shape (wheel,)
    independent: as many independent readings know as much as all whitened ones
    free, residual: the free parameters' columns and the residual, shapes (column, reading) and (1, reading)
    """

    problem: Problem
    whitening: Whitening
    deviation: Array
    independent: float
    free: Array
    residual: Array

    def squares_left(self, shape: Shape) -> float:
        """Return the sum of squares that the free parameters and friction of any usual law leave."""
        laws = _in_order(self.problem, _laws(self.problem, shape), self.whitening, self.deviation)
        return float(np.sum(_left(np.concatenate((self.free, laws)), self.residual) ** 2))

    def squares_within(self, width: float) -> float:
        """Return the same for friction that reverses within so much speed."""
        return self.squares_left({TRANSITION: width})


def _beside_a_step(problem: Problem) -> _Beside:
    free = [problem.tangent(name) for name, prior in problem.simulation.parameters.items() if prior.std > 0]
    residual = np.where(problem.mask, problem.measured - problem.filled, 0.0)
    ones = np.ones(residual.shape[1])
    as_read = _in_order(problem, [residual, *free, *_laws(problem, {})], NOT_WHITENED, ones)
    left = _left(as_read[1:], as_read[:1])[0]
    ends = np.cumsum([len(rows) for rows, _ in problem.courses])[:-1]
    parts = np.split(left, ends)
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
        whitening,
        deviation,
        float(problem.mask.sum()) / problem.noise_of(white).autocorrelation_time,
        _in_order(problem, free, whitening, deviation),
        _in_order(problem, [residual], whitening, deviation),
    )


def _laws(problem: Problem, shape: Shape) -> list[Array]:
    """Return friction that does not depend on speed, grows with its root, with it, and with the load."""
    direction, speed = along_motion(problem, shape), np.abs(problem.known("wheel_speed"))
    return [direction, direction * np.sqrt(speed), direction * speed, direction * np.abs(problem.filled)]


def _in_order(problem: Problem, columns: Sequence[Array], whitening: Whitening, deviation: Array) -> Array:
    """Return columns (time, wheel) over the noise's deviation, whitened, shape (column, reading): wheel by wheel."""
    parts = []
    for wheel, (rows, runs) in enumerate(problem.courses):
        values = np.array([column[rows, wheel] for column in columns]).reshape(len(columns), -1)
        parts.append(whitening.apply(values / deviation[wheel], runs))
    return np.concatenate(parts, axis=1)


def _left(columns: Array, residual: Array) -> Array:
    """Return what the columns leave of a residual, shape (1, reading), by least squares."""
    size = np.sqrt(np.sum(columns**2, axis=1))
    columns = columns[size > 0] / size[size > 0, None]
    fitted = np.linalg.lstsq(columns @ columns.T, columns @ residual[0], rcond=SINGULAR)[0]
    return residual - fitted @ columns


def _refined(beside: _Beside, width: float) -> tuple[float, float]:
    """Return the best transition between half and twice this one, and the sum of squares that it leaves."""
    from scipy.optimize import minimize_scalar  # noqa: PLC0415  # most recordings need no transition, and no SciPy for it

    found = minimize_scalar(
        lambda log: beside.squares_within(float(np.exp(log))),
        bounds=(np.log(width / 2), np.log(2 * width)),
        method="bounded",
        options={"xatol": REFINED_TO},
    )
    return float(np.exp(found.x)), float(found.fun)
