"""Laws that friction may follow while it reverses, and what acts about reversals without being friction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.late_columns import as_shown
from regolithd.calibration.mismatch.candidates.motion import along_motion

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.candidates.candidate import Shape
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Decay:
    """Drag that decays from standstill, as exp(−(|ω|/speed)^power)."""

    speed: float
    power: int


def about_reversals(problem: Problem) -> list[Array]:
    """Return what acts about reversals too: the inertia's acceleration, and the change of a prediction that is late.

    Each resembles friction that follows the displacement, where there is no friction.
    """
    acceleration = [problem.known("wheel_acceleration")] if problem.has("wheel_acceleration") else []
    return [*acceleration, np.nan_to_num(problem.recording.rate_of_change(problem.filled))]


def friction_laws(problem: Problem, shape: Shape) -> list[Array]:
    """Return friction that is constant, or grows with the speed, its root, its square, the load, or its square.

    On each axis it may grow with the speed, too. The first three change with temperature and time: they would seem to
    reverse with a long displacement. A late channel shows friction late: on time, it would seem to reverse so, too.
    """
    direction, speed = along_motion(problem, shape), np.abs(problem.known("wheel_speed"))
    slow = [np.ones(speed.shape), problem.time_s / problem.length_s]
    if problem.has("temperature"):
        slow.append(problem.known("temperature"))
    factors = [of_speed * each for of_speed in (1.0, np.sqrt(speed), speed) for each in slow]
    factors.append(speed**2)
    axes = np.eye(speed.shape[1])[:, None] if speed.shape[1] > 1 else ()  # one axis alone may have friction
    of_axis = [each for axis in axes for each in (axis, axis * speed)]
    load = np.abs(problem.filled)
    return list(as_shown(problem, [direction * factor for factor in (*factors, load, load**2, *of_axis)]))


def decaying_drag(problem: Problem, shape: Shape, decay: Decay) -> Array:
    """Return drag that decays with speed."""
    left = np.exp(-((np.abs(problem.known("wheel_speed")) / decay.speed) ** decay.power))
    (column,) = as_shown(problem, [along_motion(problem, shape) * left])
    return column
