"""Soil parameters as arrays, and the prior distribution of soils that simulated rovers are drawn from.

The prior is centred on the four classes of the paper's Table 1. Three in five soils lie around one class; the others
on the line between two classes, with the same spread:

| quantity | distribution around the class | source |
|---|---|---|
| cohesion | log-normal factor, σ = 0.25 | Table 2: sandy loam is reported with 3.2–4.3 kPa |
| friction angle | normal, σ = 3°, clipped to 5–42° | Table 2: sandy loam is reported with 22.7–33.7° |
| shear deformation modulus | log-normal factor, σ = 0.25 | as cohesion |
| pressure at 1 cm of sinkage | log-normal factor, σ = 0.25 | as cohesion |
| sinkage exponent | normal, σ = 0.05, clipped to 0.3–1.2 | |
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.parameters import SOILS, Soil

Array = NDArray[np.float64]

BETWEEN_CLASSES = 0.4
"""Share of the soils that lie between two classes."""
LOG_STD = 0.25
"""Standard deviation of the logarithm of cohesion, shear modulus and pressure around a class."""
ANGLE_STD_DEG = 3.0
"""Standard deviation of the friction angle around a class [°]."""
EXPONENT_STD = 0.05
"""Standard deviation of the sinkage exponent around a class."""
REFERENCE_SINKAGE_M = 0.01
"""Sinkage at which the pressure is varied, so that exponent and stiffness vary independently."""
REFERENCE_WIDTH_M = 0.07
"""Wheel width for which k_c and k_φ are added up: Kapvik's."""


@dataclass(frozen=True, slots=True, eq=False)
class Soils:
    """Many soils: arrays that broadcast with loads and slips; names and units are those of `parameters.Soil`.

    `k_c_kN` is zero: for one wheel width w, k_c/w + k_φ is one number, which `k_phi_kN` holds.
    """

    cohesion_Pa: Array
    friction_angle_deg: Array
    shear_modulus_m: Array
    sinkage_exponent: Array
    k_phi_kN: Array
    k_c_kN: ClassVar[float] = 0.0

    def per_wheel(self) -> Soils:
        """Return the same soils with a last axis of length one added, which broadcasts over the wheels."""
        return Soils(*(values[..., None] for values in self._arrays()))

    def take(self, which: NDArray[np.intp] | NDArray[np.bool_]) -> Soils:
        """Return the soils at these indices, or where the mask is true."""
        return Soils(*(values[which] for values in self._arrays()))

    def _arrays(self) -> tuple[Array, ...]:
        return (
            self.cohesion_Pa,
            self.friction_angle_deg,
            self.shear_modulus_m,
            self.sinkage_exponent,
            self.k_phi_kN,
        )


def soils_from(soils: list[Soil], width_m: float = REFERENCE_WIDTH_M) -> Soils:
    """Return soils as arrays of shape (len(soils),), for wheels of one width [m]: k_φ becomes k_c/w + k_φ."""
    return Soils(
        np.array([soil.cohesion_Pa for soil in soils], np.float64),
        np.array([soil.friction_angle_deg for soil in soils], np.float64),
        np.array([soil.shear_modulus_m for soil in soils]),
        np.array([soil.sinkage_exponent for soil in soils]),
        np.array([soil.k_c_kN / width_m + soil.k_phi_kN for soil in soils]),
    )


def draw_soils(count: int, rng: np.random.Generator) -> tuple[Soils, NDArray[np.intp]]:
    """Draw soils from the prior.

    Parameters
    ----------
    count
        How many.
    rng
        Source of randomness.

    Returns
    -------
    tuple
        The soils, each array of shape (count,), and for each the index in `SOILS` of the class that it is nearest to.
    """
    classes = soils_from(list(SOILS.values()))
    first = rng.integers(len(SOILS), size=count)
    second = (first + rng.integers(1, len(SOILS), size=count)) % len(SOILS)
    share = np.where(rng.random(count) < BETWEEN_CLASSES, rng.uniform(0, 0.5, count), 0.0)

    def between(values: Array) -> Array:
        return (1 - share) * values[first] + share * values[second]

    def factor() -> Array:
        return np.exp(LOG_STD * rng.standard_normal(count))

    exponent = between(classes.sinkage_exponent) + EXPONENT_STD * rng.standard_normal(count)
    pressure = np.log(classes.k_phi_kN) + classes.sinkage_exponent * np.log(REFERENCE_SINKAGE_M)
    exponent = np.clip(exponent, 0.3, 1.2)
    angle = between(classes.friction_angle_deg) + ANGLE_STD_DEG * rng.standard_normal(count)
    drawn = Soils(
        cohesion_Pa=np.exp(between(np.log(classes.cohesion_Pa))) * factor(),
        friction_angle_deg=np.clip(angle, 5, 42),
        shear_modulus_m=np.exp(between(np.log(classes.shear_modulus_m))) * factor(),
        sinkage_exponent=exponent,
        k_phi_kN=np.exp(between(pressure) - exponent * np.log(REFERENCE_SINKAGE_M)) * factor(),
    )
    return drawn, first
