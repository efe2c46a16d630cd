"""Lateral forces on a wheel in sand at a slip angle: four candidates."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch import Candidate, Coefficient, Shape

if TYPE_CHECKING:
    from regolithd.calibration.mismatch import Array, Problem


def sideways(travel_mm_s: Array, rim_mm_s: Array, slip_angle_rad: Array) -> Array:
    """Return the lateral component of the unit vector of sliding in the contact."""
    across = travel_mm_s * np.sin(slip_angle_rad)
    return across / np.maximum(np.hypot(rim_mm_s - travel_mm_s * np.cos(slip_angle_rad), across), 1e-9)


class SideForce(Candidate):
    """A force that depends on the slip angle."""

    covariate = "slip_angle"
    along_motion = False
    experiment = "tow the wheel at one slip through slip angles from 0 to 90 degrees, at two loads"
    requires = ("slip_angle", "sinkage", "load", "sideways")
    sharing: ClassVar = ("one",)
    signature = "a force that is zero straight ahead and grows with the slip angle"


class SideShear(SideForce):
    """Lateral shear of the sand over a contact area that grows with sinkage."""

    name = "side-shear"
    equation = "ΔF = k z v_y/|v|"
    words = "shear of the sand across the wheel, in the direction in which the contact slides"
    source = "Ishigami et al. (2007): shear follows the direction of sliding"
    coefficients: ClassVar = (Coefficient("shear_per_sinkage", "{unit}/mm"),)

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002  # it has no shape
        """Return sinkage × lateral part of the sliding direction."""
        return (problem.covariates["sinkage"] * problem.covariates["sideways"])[None]


class Bulldozing(SideForce):
    """Passive earth pressure on the wheel's flank, with the square of sinkage."""

    name = "bulldozing"
    equation = "ΔF = b z² sin β"
    words = "sand that the wheel's flank pushes aside"
    source = "Hegedus (1960): passive pressure on a flank grows with sinkage squared"
    coefficients: ClassVar = (Coefficient("resistance_per_sinkage_squared", "{unit}/mm²"),)

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002  # it has no shape
        """Return sinkage² × sin β."""
        return (problem.covariates["sinkage"] ** 2 * np.sin(problem.covariates["slip_angle"]))[None]


class SideFriction(SideForce):
    """Lateral Coulomb friction of the load."""

    name = "side-friction"
    equation = "ΔF = μ W sin β"
    words = "friction of the load across the wheel"
    source = "Coulomb friction of a tyre on a road"
    coefficients: ClassVar = (Coefficient("friction_coefficient", "1"),)

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002  # it has no shape
        """Return load × sin β."""
        return (problem.covariates["load"] * np.sin(problem.covariates["slip_angle"]))[None]


class TurnedTraction(SideForce):
    """Traction reduced by the slip angle: the part of the straight-ahead force that is not along the wheel is lost."""

    name = "turned-traction"
    equation = "ΔF = −a F_straight (1 − cos β)"
    words = "traction lost because the wheel slides at an angle"
    source = "geometry: the sliding direction turns by the slip angle"
    coefficients: ClassVar = (Coefficient("share_lost", "1"),)

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002  # it has no shape
        """Return −F (1 − cos β) with the straight-ahead force F."""
        return (-problem.filled * (1 - np.cos(problem.covariates["slip_angle"])))[None]


CANDIDATES = (SideShear(), Bulldozing(), SideFriction(), TurnedTraction())
"""All four."""
