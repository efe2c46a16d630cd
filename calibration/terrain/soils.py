"""Soils as arrays: the same formulas for thousands of soils at once, and what soils a rover may meet.

The soils of Table 1 are four points; a rover meets what lies around and between them. Reported values of one soil
differ (Table 2: sandy loam 3.2–4.3 kPa and 22.7–33.7°), and so far a drawn soil may lie from its class:

| quantity | around a class |
|---|---|
| cohesion | factor, log-normal, 0.25 |
| friction angle | ± 3°, normal, kept within 5–42° |
| shear modulus | factor, log-normal, 0.25 |
| pressure at 1 cm of sinkage | factor, log-normal, 0.25 |
| sinkage exponent | ± 0.05, normal, kept within 0.3–1.2 |

Three in five lie around one class; the others between two of them, anywhere on the way, with the same spread.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.parameters import SOILS, Soil

Array = NDArray[np.float64]

BETWEEN = 0.4
SPREAD = 0.25
ANGLE_SPREAD_DEG = 3.0
EXPONENT_SPREAD = 0.05
REFERENCE_SINKAGE_M = 0.01
REFERENCE_WIDTH_M = 0.07


@dataclass(frozen=True, slots=True, eq=False)
class Soils:
    """Many soils: each field an array that broadcasts with loads and slips; names and units as in `parameters.Soil`.

    `k_c_kN` is zero: for one wheel width, Wong's two stiffnesses are one number.
    """

    cohesion_Pa: Array
    friction_angle_deg: Array
    shear_modulus_m: Array
    sinkage_exponent: Array
    k_phi_kN: Array
    k_c_kN: ClassVar[float] = 0.0

    def per_wheel(self) -> Soils:
        """Return the same soils with a last axis of length one, which broadcasts over the wheels."""
        return Soils(*(values[..., None] for values in self._arrays()))

    def take(self, which: NDArray[np.intp] | NDArray[np.bool_]) -> Soils:
        """Return some of them."""
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
    """Return configured soils as arrays, shape (soils,), for wheels of one width."""
    return Soils(
        np.array([soil.cohesion_Pa for soil in soils], np.float64),
        np.array([soil.friction_angle_deg for soil in soils], np.float64),
        np.array([soil.shear_modulus_m for soil in soils]),
        np.array([soil.sinkage_exponent for soil in soils]),
        np.array([soil.k_c_kN / width_m + soil.k_phi_kN for soil in soils]),
    )


def draw_soils(count: int, rng: np.random.Generator) -> tuple[Soils, NDArray[np.intp]]:
    """Return soils that a rover may meet, shape (count,), and for each the class of Table 1 that it lies nearest to."""
    classes = soils_from(list(SOILS.values()))
    first = rng.integers(len(SOILS), size=count)
    second = (first + rng.integers(1, len(SOILS), size=count)) % len(SOILS)
    share = np.where(rng.random(count) < BETWEEN, rng.uniform(0, 0.5, count), 0.0)

    def between(values: Array) -> Array:
        return (1 - share) * values[first] + share * values[second]

    def spread() -> Array:
        return np.exp(SPREAD * rng.standard_normal(count))

    exponent = between(classes.sinkage_exponent) + EXPONENT_SPREAD * rng.standard_normal(count)
    pressure = np.log(classes.k_phi_kN) + classes.sinkage_exponent * np.log(REFERENCE_SINKAGE_M)
    exponent = np.clip(exponent, 0.3, 1.2)
    angle = between(classes.friction_angle_deg) + ANGLE_SPREAD_DEG * rng.standard_normal(count)
    drawn = Soils(
        cohesion_Pa=np.exp(between(np.log(classes.cohesion_Pa))) * spread(),
        friction_angle_deg=np.clip(angle, 5, 42),
        shear_modulus_m=np.exp(between(np.log(classes.shear_modulus_m))) * spread(),
        sinkage_exponent=exponent,
        k_phi_kN=np.exp(between(pressure) - exponent * np.log(REFERENCE_SINKAGE_M)) * spread(),
    )
    return drawn, first
