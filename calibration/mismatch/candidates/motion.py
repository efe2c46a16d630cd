"""The direction of motion, as laws of friction depend on it: a step at standstill, or gradually about a reversal.

Dry friction does not reverse at once. Before it slides, a contact yields like a spring (presliding): the friction
follows the displacement since the reversal, whatever the speed (Dahl, 1968). And a speed that is measured with noise or
averaged over a reading crosses zero gradually. How far, or how slow, belongs to the machine, not to one law, so it is
found once for a recording (`reversal.py`) and stands in the shape of each law that reverses.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.noise_models.recursion import recursion

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.candidates.candidate import Shape
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

TRANSITION = "transition_rad_s"
"""The shape parameter of a law that reverses: the speed at which the friction has reversed by three quarters."""
PRESLIDING = "presliding_rad"
"""The shape parameter of a law that reverses: the displacement after which all but 1/e of the friction has reversed."""
REVERSAL_KEYS = {
    TRANSITION: "ω_t of a friction that reverses with the speed: its law times tanh(|ω|/ω_t)",
    PRESLIDING: "θ_p of a friction that reverses with the displacement, in the unit of ω times s: its law times "
    "z sign(ω), dz = (sign(ω) − z) |dθ|/θ_p (without either key: at once)",
}
"""What the keys mean, for the documentation."""


def along_motion(problem: Problem, shape: Shape) -> Array:
    """Return sign(ω), or as it reverses where the shape says so, 0 at standstill, shape (time, wheel)."""
    direction = problem.known("direction")
    if TRANSITION in shape:
        return np.asarray(direction * np.tanh(np.abs(problem.known("wheel_speed")) / float(shape[TRANSITION])))
    if PRESLIDING in shape:
        return np.where(direction != 0, _yielded(problem, float(shape[PRESLIDING])), 0.0)
    return np.asarray(direction)


def displacement_of(problem: Problem) -> Array:
    """Return the displacement since the instant before, without noise at standstill, shape (time, wheel).

    It is ∞ where a run starts and after a gap: what happened before is not known.
    """
    return problem.once("displacement", lambda: _displacement_of(problem))


def _displacement_of(problem: Problem) -> Array:
    recording, moving = problem.recording, problem.known("direction") != 0
    speed = np.where(moving, np.abs(problem.known("wheel_speed")), 0.0)
    travelled = 0.5 * (speed[1:] + speed[:-1]) * np.diff(recording.time_s)[:, None]
    displacement = np.full(speed.shape, np.inf)
    displacement[1:] = np.where(recording.without_gap[:, None], travelled, np.inf)
    return displacement


def _yielded(problem: Problem, presliding: float) -> Array:
    """Return which share of a friction, with its sign, acts at each reading, exact between reversals."""
    kept = np.exp(-displacement_of(problem) / presliding)
    return recursion(kept, (1 - kept) * problem.known("direction"))
