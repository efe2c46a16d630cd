"""What a slip angle may do to a wheel in sand: four physical candidates, each a few lines."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch import Candidate, Coefficient, Shape

if TYPE_CHECKING:
    from regolithd.calibration.mismatch import Array, Problem


def sideways(travel_mm_s: Array, rim_mm_s: Array, slip_angle_rad: Array) -> Array:
    """Return how much of the contact's sliding goes across the wheel: the lateral part of its unit vector."""
    across = travel_mm_s * np.sin(slip_angle_rad)
    return across / np.maximum(np.hypot(rim_mm_s - travel_mm_s * np.cos(slip_angle_rad), across), 1e-9)


class SideForce(Candidate):
    """A force of the slip angle."""

    covariate = "slip_angle"
    experiment = "tow the wheel at one slip through slip angles from 0 to 90 degrees, at two loads"
    requires = ("slip_angle", "sinkage", "load", "sideways")
    sharing: ClassVar = ("one",)
    signature = "a force that is not there straight ahead and grows with the slip angle"


class SideShear(SideForce):
    """Sand sheared across the wheel, over a contact that grows with sinkage."""

    name = "side-shear"
    equation = "ΔF = k z v_y/|v|"
    words = "shear of the sand across the wheel, in the direction in which the contact slides"
    source = "Ishigami et al. (2007): shear follows the direction of sliding"
    coefficients: ClassVar = (Coefficient("shear_per_sinkage", "{unit}/mm"),)

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002  # it has no shape
        """Return sinkage × lateral part of the sliding direction."""
        return (problem.covariates["sinkage"] * problem.covariates["sideways"])[None]


class Bulldozing(SideForce):
    """Sand pushed aside by the wheel's flank: passive earth pressure, with the square of sinkage."""

    name = "bulldozing"
    equation = "ΔF = b z² sin β"
    words = "sand that the wheel's flank pushes aside"
    source = "Hegedus (1960): passive pressure on a flank grows with sinkage squared"
    coefficients: ClassVar = (Coefficient("resistance_per_sinkage_squared", "{unit}/mm²"),)

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002  # it has no shape
        """Return sinkage² × sin β."""
        return (problem.covariates["sinkage"] ** 2 * np.sin(problem.covariates["slip_angle"]))[None]


class SideFriction(SideForce):
    """Coulomb friction of the load, across."""

    name = "side-friction"
    equation = "ΔF = μ W sin β"
    words = "friction of the load across the wheel"
    source = "a tyre on a road; sand has no such surface"
    coefficients: ClassVar = (Coefficient("friction_coefficient", "1"),)

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002  # it has no shape
        """Return load × sin β."""
        return (problem.covariates["load"] * np.sin(problem.covariates["slip_angle"]))[None]


class TurnedTraction(SideForce):
    """Traction that turns with the slip angle: of what straight driving has, only the part along the wheel is left."""

    name = "turned-traction"
    equation = "ΔF = −a F_straight (1 − cos β)"
    words = "traction lost because the wheel slides at an angle"
    source = "geometry: the sliding direction turns by the slip angle"
    coefficients: ClassVar = (Coefficient("share_lost", "1"),)

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002  # it has no shape
        """Return what a cosine takes from the straight-ahead force."""
        return (-problem.filled * (1 - np.cos(problem.covariates["slip_angle"])))[None]


CANDIDATES = (SideShear(), Bulldozing(), SideFriction(), TurnedTraction())
"""The four."""
