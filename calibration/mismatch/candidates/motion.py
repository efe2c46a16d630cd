"""The direction of motion, as laws of friction depend on it: a step at standstill, or a smooth transition about it.

Dry friction does not turn round at once: before it slides, a contact yields (presliding), and a speed that is measured
with noise or averaged over a reading crosses zero gradually. How slow "slow" is belongs to the machine, not to one law,
so it is found once for a recording and stands in the shape of each law that reverses.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.covariates import USUAL_SPEED_QUANTILE

if TYPE_CHECKING:
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
    step = _left_beside_friction(problem, {})
    noise = problem.noise_of(step)
    count = float(problem.mask.sum()) / noise.autocorrelation_time
    best, left = _refined(problem, min(widths, key=lambda width: _squares_left(problem, width)))
    gain = count * (1 - left / max(_squares(step), 1e-300))
    return best if gain > LEAST_GAIN else 0.0


def _refined(problem: Problem, width: float) -> tuple[float, float]:
    """Return the best transition between half and twice this one, and the sum of squares that it leaves."""
    from scipy.optimize import minimize_scalar  # noqa: PLC0415  # most recordings need no transition, and no SciPy for it

    found = minimize_scalar(
        lambda log: _squares_left(problem, float(np.exp(log))),
        bounds=(np.log(width / 2), np.log(2 * width)),
        method="bounded",
        options={"xatol": REFINED_TO},
    )
    return float(np.exp(found.x)), float(found.fun)


def _squares_left(problem: Problem, width: float) -> float:
    return _squares(_left_beside_friction(problem, {TRANSITION: width}))


def _left_beside_friction(problem: Problem, shape: Shape) -> Array:
    """Return what the free parameters and friction of any usual law leave of the residual, shape (time, wheel)."""
    direction, speed = along_motion(problem, shape), np.abs(problem.known("wheel_speed"))
    laws = [direction, direction * np.sqrt(speed), direction * speed, direction * np.abs(problem.filled)]
    free = [problem.tangent(name) for name, prior in problem.simulation.parameters.items() if prior.std > 0]
    here = problem.mask
    residual = np.where(here, problem.measured - problem.filled, 0.0)
    columns = np.stack([column[here] for column in (*free, *laws)], axis=1)
    fitted = np.linalg.lstsq(columns, residual[here], rcond=None)[0]
    residual[here] -= columns @ fitted
    return residual


def _squares(residual: Array) -> float:
    return float(np.sum(residual**2))
