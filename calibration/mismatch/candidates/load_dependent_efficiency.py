"""Gear losses that depend on the transmitted torque."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import (
    SHAPE_TOLERANCE,
    UNLIKELY_SHAPE_PENALTY,
    Array,
    Candidate,
    Coefficient,
    Shape,
)
from regolithd.calibration.mismatch.candidates.motion import REVERSAL_KEYS, along_motion
from regolithd.calibration.mismatch.candidates.reversal import reversal_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem

SAME_AS_GAIN = 0.95
"""Cosine between a loss in proportion to the torque and the torque itself, above which it is a wrong gain (a choice:
the load drives the motor for a fortieth of the torque's energy at most)."""
LIGHTEST, HEAVIEST = 0.1, 3.0
"""Ends of the decay scale, in reference torques (a choice: of the first nothing is left at a third of the reference, of
the second a third at three times it)."""
LEAST_POWER = 0.2
"""Least power of the torque that is told from a constant share (a choice)."""
LARGEST_LOSS = 2 / 3
"""Largest share of the stated efficiency that may be lost at any torque (a choice: a third is left)."""
USUAL_TORQUE_QUANTILE = 0.98
"""Quantile of the torques up to which a loss has to be possible (a choice: one reading in fifty may be disturbed)."""
LESS_THAN_PREDICTED = "less than is predicted, by a share that depends on the transmitted torque"
"""What a loss below zero is."""
POWERS, LIGHT_LOADS, SLOPES = (0.0, 0.5, 1.0, 2.0), (0.25, 0.5, 1.0), (-0.2, 0.0, 0.3)
"""Grid of the three forms: powers of torque, decay scales in reference torques, slopes of the efficiency (a choice).
What is lost grows with the cube of the torque at most: teeth and bearings lose in proportion to it, a motor's winding
with its square, and a steeper law is that of a threshold, such as a tyre that gives way."""


class LoadDependentEfficiency(Candidate):
    """An efficiency that varies with torque, in one of three forms. What is lost is lost against the motion.

    The torque is taken relative to a reference, the predicted channel's mean magnitude in the recording in which the
    effect is identified; it is part of the shape (`reference_size`, in the channel's unit), so that the law holds for
    any other recording.

    `power`: the relative loss grows as a power p of the torque; with power 0 it is a constant share, so that the stated
    gain is wrong by more than its stated uncertainty. `light`: the loss decays exponentially with the torque, by a
    factor e over `light` reference torques. `bent`: the efficiency is the stated one at the reference torque and falls
    linearly with the torque above it, so that the current is I/(1 − a x); `bent` is a.

    A `relative_loss` below 0 is that of a machine that needs less than predicted: its loss is smaller than the stated
    one. Of the linear efficiency it is one that rises with the torque.
    """

    name = "load-dependent-efficiency"
    covariate = "torque"
    equation = (
        "Δy = a |y_sim| |y_sim/y_ref|^p sign(ω), a |y_sim| exp(−|y_sim|/(l y_ref)) sign(ω), "
        "or |y_sim| (1/(1 − a x) − 1) sign(ω), x = |y_sim|/y_ref − 1"
    )
    words = "a loss that depends on the transmitted torque"
    signature = "a residual along the prediction, curved against it"
    experiment = "carry at least three different loads at each {wheel_speed}"
    source = "CSF-11 efficiency over load (maker's chart): 0.3 to 0.7 from a tenth of rated torque to rated"
    requires = ("torque",)
    loads = True
    forms = ("constant share", "power of the torque", "exponential decay with the torque", "linear efficiency")
    shape_keys: ClassVar = {
        "reference_size": "y_ref",
        "power": "p (0: a constant share)",
        "light": "l",
        "bent": "a of the linear efficiency",
        **REVERSAL_KEYS,
    }
    coefficients: ClassVar = (Coefficient("relative_loss", "1", 0),)
    refined: ClassVar = {"power": (LEAST_POWER, max(POWERS)), "light": (LIGHTEST, HEAVIEST)}

    def words_with(self, shape: Shape, values: Mapping[str, float]) -> str:
        """Return what a negative coefficient means, which is no loss."""
        if values["relative_loss"] >= 0:
            return self.words_for(shape)
        return "an efficiency that rises with the transmitted torque" if "bent" in shape else LESS_THAN_PREDICTED

    def form_of(self, shape: Shape) -> str:
        """Return what the relative loss, or the efficiency, is as a function of the torque."""
        constant, power, light, bent = self.forms
        if "bent" in shape:
            return bent
        if "light" in shape:
            return light
        return power if shape["power"] else constant

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Return powers from proportional to strongly curved, losses at light load, and linear efficiencies."""
        curved: list[Shape] = [{"power": p} for p in POWERS]
        light: list[Shape] = [{"light": s} for s in LIGHT_LOADS]
        bent: list[Shape] = [{"bent": b} for b in SLOPES]
        reference = max(float(np.mean(np.abs(problem.filled[problem.mask]))), 1e-30)
        return [{**reversal_of(problem), **form, "reference_size": reference} for form in (*curved, *light, *bent)]

    def refinable(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:
        """Return the range of the power or of the scale; a constant share has neither."""
        return super().refinable(problem, shape) if shape.get("power") != 0 else {}

    def self_consistent_shape(self, problem: Problem, shape: Shape, values: Sequence[float]) -> Shape:
        """Return the linear efficiency with the fitted slope, as long as at least a third of the efficiency is left."""
        if "bent" not in shape:
            return shape
        above = _relative(problem, shape)[problem.mask] - 1
        least, most = LARGEST_LOSS / min(float(np.min(above)), -1e-9), LARGEST_LOSS / max(float(np.max(above)), 1e-9)
        bent = float(np.clip(values[0], least, most))
        return shape if abs(bent - float(shape["bent"])) <= SHAPE_TOLERANCE * abs(bent) else {**shape, "bent": bent}

    def prior_penalty(self, problem: Problem, shape: Shape) -> float:
        """Charge a loss proportional to torque where the load never drives: there it contradicts the stated gain."""
        if shape.get("power") != 0.0:
            return 0.0
        lost, torque = _against_motion(problem, shape)[problem.mask], problem.filled[problem.mask]
        alike = float(lost @ torque) / max(float(np.linalg.norm(lost) * np.linalg.norm(torque)), 1e-300)
        return UNLIKELY_SHAPE_PENALTY if alike > SAME_AS_GAIN else 0.0

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return the loss as a multiple of the predicted size, against the motion."""
        return (_against_motion(problem, shape) * _of_size(problem, shape))[None]

    def plausible(self, problem: Problem, shape: Shape, values: Sequence[float]) -> bool:
        """Return whether at the usual torques at least a third of the efficiency is left, and no more is gained.

        What is lost at light load may exceed the load, as the loss of a gear without any does: where the loss decays
        with the torque, it is held against the reference torque.
        """
        usual = (1 - USUAL_TORQUE_QUANTILE, USUAL_TORQUE_QUANTILE)
        of_size = _of_size(problem, shape)
        if "light" in shape and values[0] > 0:
            of_size = of_size * np.minimum(_relative(problem, shape), 1.0)
        lost = values[0] * np.quantile(of_size[problem.mask], usual)
        return bool(lost.min() >= -LARGEST_LOSS and lost.max() <= LARGEST_LOSS / (1 - LARGEST_LOSS))


def _of_size(problem: Problem, shape: Shape) -> Array:
    """Return what is lost for a coefficient of 1 as a multiple of the predicted size, shape (time, wheel)."""
    relative = _relative(problem, shape)
    if "bent" in shape:
        above = relative - 1
        # At torques beyond those of the identification, the line ends where a third of the efficiency is left.
        return np.asarray(above / np.maximum(1 - float(shape["bent"]) * above, 1 - LARGEST_LOSS))
    if "light" in shape:
        return np.exp(-relative / float(shape["light"]))
    return np.asarray(relative ** float(shape["power"]))


def _against_motion(problem: Problem, shape: Shape) -> Array:
    """Return the predicted size with the sign of a loss: a load that drives the motor loses as well."""
    if "direction" not in problem.covariates:
        return problem.filled
    return np.abs(problem.filled) * along_motion(problem, shape)


def _relative(problem: Problem, shape: Shape) -> Array:
    """Return the predicted size over the reference, shape (time, wheel)."""
    return np.asarray(np.abs(problem.filled) / float(shape["reference_size"]))
