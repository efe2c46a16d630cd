"""Parameters of rover, wheel, drivetrain, sensors and soil: the tables that `rover.toml` and `SIM.toml` have in common.

Each table is one pydantic model. Names end in their unit. Defaults are those of the micro-rover Kapvik (the paper, and
the manufacturers' data sheets where the paper gives no value). A `…_std` is a standard deviation in the unit of its
value, a `…_relative_std` one relative to the value; both state how well a value is known before any recording, and 0
means exactly.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidatorFunctionWrapHandler, field_validator
from pydantic_core import PydanticCustomError

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Efficiency = Annotated[float, Field(gt=0, le=1)]
# Ranges that no small rover and no bench leaves, and that a value in another unit (mm, g, mA) does.
Length = Annotated[float, Field(ge=0.05, le=5.0)]
WheelSize = Annotated[float, Field(ge=0.005, le=0.5)]
Mass = Annotated[float, Field(ge=0.1, le=1000.0)]
Current = Annotated[float, Field(strict=True, ge=0.0, le=5.0)]
ViscousCurrent = Annotated[float, Field(strict=True, ge=0.0, le=0.1)]
TorqueConstant = Annotated[float, Field(ge=0.0005, le=2.0)]
Ratio = Annotated[float, Field(ge=0.01, le=10_000.0)]
Factor = Annotated[float, Field(strict=True, ge=0.01, le=100.0)]
Share = Annotated[float, Field(strict=True, ge=0.0, le=10.0)]
Force = Annotated[float, Field(strict=True, ge=-10_000.0, le=10_000.0)]
ForceStd = Annotated[float, Field(strict=True, ge=0.0, le=10_000.0)]
LoadLoss = Annotated[float, Field(strict=True, ge=-10.0, le=10.0)]

GRAVITY_M_S2 = 9.80665
"""Standard acceleration of gravity g_n (3rd CGPM, 1901)."""


def _one_or_six(value: object) -> object:
    """Return six equal values where a single number was given."""
    return (value,) * 6 if isinstance(value, int | float) else value


SixNotNegative = Annotated[
    tuple[NotNegative, NotNegative, NotNegative, NotNegative, NotNegative, NotNegative], BeforeValidator(_one_or_six)
]
SixCurrents = Annotated[tuple[Current, Current, Current, Current, Current, Current], BeforeValidator(_one_or_six)]
SixViscousCurrents = Annotated[
    tuple[ViscousCurrent, ViscousCurrent, ViscousCurrent, ViscousCurrent, ViscousCurrent, ViscousCurrent],
    BeforeValidator(_one_or_six),
]
SixFactors = Annotated[tuple[Factor, Factor, Factor, Factor, Factor, Factor], BeforeValidator(_one_or_six)]
SixShares = Annotated[tuple[Share, Share, Share, Share, Share, Share], BeforeValidator(_one_or_six)]
SixForces = Annotated[tuple[Force, Force, Force, Force, Force, Force], BeforeValidator(_one_or_six)]
SixForceStds = Annotated[
    tuple[ForceStd, ForceStd, ForceStd, ForceStd, ForceStd, ForceStd], BeforeValidator(_one_or_six)
]
SixLoadLosses = Annotated[
    tuple[LoadLoss, LoadLoss, LoadLoss, LoadLoss, LoadLoss, LoadLoss], BeforeValidator(_one_or_six)
]


def _kind_expected(given: object, taken: object) -> str:
    """Return what should have been given, where pydantic took a text or a truth value for a number, or the reverse."""
    if isinstance(taken, dict):
        values = given.values() if isinstance(given, dict) else ()
        return next(filter(None, map(_kind_expected, values, taken.values())), "")
    if isinstance(taken, tuple | list):
        each = given if isinstance(given, tuple | list) else (given,)
        return next(filter(None, map(_kind_expected, each, taken)), "")
    if isinstance(taken, bool):
        return "" if isinstance(given, bool) else "true or false"
    is_number = isinstance(taken, int | float) and not isinstance(taken, str)
    return "a number" if is_number and isinstance(given, bool | str | bytes) else ""


class Table(BaseModel):
    """A TOML table: unknown keys are errors, and the fields cannot be assigned."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @field_validator("*", mode="wrap")
    @classmethod
    def _as_written(cls, value: object, take: ValidatorFunctionWrapHandler) -> object:
        """Convert no text and no truth value to a number, and no number to a truth value."""
        taken = take(value)
        if kind := _kind_expected(value, taken):
            raise PydanticCustomError("as_written", kind)
        return taken


class Drivetrain(Table):
    """Motor, planetary gear and harmonic drive: the constants of Eq. 11, and four that are measured at the bench.

    The measured constants have one value for each wheel, or one for all six. Eq. 11 has none of them; with their
    defaults the drivetrain is Eq. 11 (`drivetrain.torque` has the equations).

    | field | symbol | meaning | measured by |
    |---|---|---|---|
    | `no_load_current_A` | I_c | Coulomb part of the no-load current | `regolithd calibrate wheels-up` |
    | `viscous_current_A_s_per_rad` | b | no-load current per motor speed | `regolithd calibrate wheels-up` |
    | `gain_factor` | f | factor on the gain of Eq. 11 | `regolithd calibrate brake` |
    | `load_loss_per_Nm` | λ | relative increase of the current per torque | `regolithd calibrate brake` |
    """

    torque_constant_Nm_per_A: TorqueConstant = 0.0234
    planetary_ratio: Ratio = 14.0
    planetary_efficiency: Efficiency = 0.70
    harmonic_ratio: Ratio = 100.0
    harmonic_efficiency: Efficiency = 0.70
    gain_relative_std: Share = 0.0
    no_load_current_A: SixCurrents = (0.0,) * 6
    no_load_current_std_A: SixCurrents = (0.0,) * 6
    viscous_current_A_s_per_rad: SixViscousCurrents = (0.0,) * 6
    viscous_current_std_A_s_per_rad: SixViscousCurrents = (0.0,) * 6
    gain_factor: SixFactors = (1.0,) * 6
    gain_factor_std: SixShares = (0.0,) * 6
    load_loss_per_Nm: SixLoadLosses = (0.0,) * 6
    load_loss_std_per_Nm: SixShares = (0.0,) * 6

    @property
    def ratio(self) -> float:
        """Motor turns per wheel turn, ζ_PG ζ_HD [1]."""
        return self.planetary_ratio * self.harmonic_ratio

    @property
    def gain_Nm_per_A(self) -> float:
        """Wheel torque per motor current, κ ζ_PG ζ_HD η_PG η_HD [N·m/A] (Eq. 11)."""
        return self.torque_constant_Nm_per_A * self.ratio * self.planetary_efficiency * self.harmonic_efficiency


class LoadCells(Table):
    """Calibration of the load cells: load = `span` × (reading − `zero_N`); six values, or one for all."""

    zero_N: SixForces = (0.0,) * 6
    zero_std_N: SixForceStds = (0.0,) * 6
    span: SixFactors = (1.0,) * 6
    span_std: SixShares = (0.0,) * 6


class Wheel(Table):
    """A rigid wheel without grousers."""

    radius_m: WheelSize = 0.075
    radius_std_m: Annotated[float, Field(ge=0.0, le=0.1)] = 0.0
    width_m: WheelSize = 0.07


class Rover(Table):
    """Mass and geometry of the rover's body."""

    mass_kg: Mass = 30.0
    wheelbase_m: Length = 0.65
    track_m: Length = 0.55


class Soil(Table):
    """One soil: Mohr–Coulomb strength, shear deformation modulus (Janosi), pressure–sinkage constants (Wong).

    `k_c_kN` is in kN/m^(n+1) and `k_phi_kN` in kN/m^(n+2), as in Wong's tables ("Theory of Ground Vehicles").
    """

    cohesion_Pa: NotNegative
    friction_angle_deg: Annotated[float, Field(gt=0, lt=60)]
    shear_modulus_m: Positive
    sinkage_exponent: Positive
    k_c_kN: float
    k_phi_kN: Positive
    cohesion_relative_std: NotNegative = 0.0
    friction_angle_relative_std: NotNegative = 0.0


class Sensors(Table):
    """Errors of the recorded inputs, as standard deviations."""

    load_relative_std: NotNegative = 0.0
    ground_speed_relative_std: NotNegative = 0.0
    pitch_std_rad: NotNegative = 0.0
    roll_std_rad: NotNegative = 0.0
    yaw_rate_std_rad_s: NotNegative = 0.0
    temperature_std_degC: NotNegative = 0.0


SOILS = {
    "lete-sand": Soil(
        cohesion_Pa=1220,
        friction_angle_deg=30.3,
        shear_modulus_m=0.0116,
        sinkage_exponent=0.79,
        k_c_kN=102,
        k_phi_kN=5301,
    ),
    "sandy-loam": Soil(
        cohesion_Pa=3150,
        friction_angle_deg=30.0,
        shear_modulus_m=0.0420,
        sinkage_exponent=0.66,
        k_c_kN=6.9,
        k_phi_kN=752,
    ),
    "clayey-soil": Soil(
        cohesion_Pa=4120,
        friction_angle_deg=11.8,
        shear_modulus_m=0.0254,
        sinkage_exponent=0.50,
        k_c_kN=13.19,
        k_phi_kN=692.15,
    ),
    "medium-soil": Soil(
        cohesion_Pa=6410,
        friction_angle_deg=25.7,
        shear_modulus_m=0.0238,
        sinkage_exponent=0.80,
        k_c_kN=29.76,
        k_phi_kN=2083,
    ),
}
"""The soils of the paper's Table 1, with Wong's pressure–sinkage constants for the same soils."""
