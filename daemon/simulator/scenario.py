"""The scenario file (TOML) of the virtual rover: soils, motion, sensor noise, hidden effects. Every key is optional.

    seed = 7
    [[ground.stretches]]
    soil = "sandy-loam"
    until_m = 5.0
    [[ground.stretches]]
    soil = "clayey-soil"
    [noise]
    drops_per_s = 0.0

Tables that `rover.toml` also has are the same models. The defaults are Kapvik on its field trial.
"""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING, Annotated

from pydantic import BeforeValidator, Field, model_validator

from regolithd.calibration.parameters import (
    SOILS,
    Drivetrain,
    NotNegative,
    Positive,
    Rover,
    SixNotNegative,
    Soil,
    Table,
    Wheel,
)

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Self

Fraction = Annotated[float, Field(ge=0, le=1)]
WheelNumber = Annotated[int, Field(ge=1, le=6)]


def _named_soil(value: object) -> object:
    """Return the soil of this name; a table is returned unchanged."""
    if not isinstance(value, str):
        return value
    if value not in SOILS:
        raise ValueError(f"no soil is called {value!r}; known are {', '.join(SOILS)}")
    return SOILS[value]


class Stretch(Table):
    """A soil up to a distance [m] from where the rover's middle axle starts; the last stretch has no end."""

    soil: Annotated[Soil, BeforeValidator(_named_soil)]
    until_m: float | None = None

    @property
    def name(self) -> str:
        """The soil's name in Table 1, or its cohesion and friction angle."""
        for name, soil in SOILS.items():
            if soil == self.soil:
                return name
        return f"c = {self.soil.cohesion_Pa:g} Pa, φ = {self.soil.friction_angle_deg:g}°"


class Ground(Table):
    """`[ground]`: soils along the path, and its slope: a constant one plus a sine wave."""

    stretches: Annotated[tuple[Stretch, ...], Field(min_length=1)] = (Stretch(soil=SOILS["sandy-loam"]),)
    pitch_deg: Annotated[float, Field(ge=-30, le=30)] = 0.0
    roll_deg: Annotated[float, Field(ge=-30, le=30)] = 0.0
    wave_deg: Annotated[float, Field(ge=0, le=10)] = 0.5
    wave_length_m: Positive = 1.7

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        ends = [stretch.until_m for stretch in self.stretches]
        given = [end for end in ends[:-1] if end is not None]
        if len(given) < len(ends) - 1 or given != sorted(set(given)) or ends[-1] is not None:
            raise ValueError("each stretch but the last needs an `until_m`, each further than the one before")
        return self


class Motion(Table):
    """`[motion]`: the wheels' slip, prescribed: it is not solved from the drawbar pull.

    `slip` applies on level ground; `slip_per_grade` times the sine of the pitch is added.
    """

    slip: Annotated[float, Field(gt=-0.5, lt=0.9)] = 0.025
    slip_per_grade: NotNegative = 0.3
    centre_of_mass_m: Positive = 0.2


class SensorNoise(Table):
    """`[noise]`: total relative standard deviations of Tables 4 and 6 (prepared ground), and how they divide.

    A current varies with the load, by momentary drops (`drops_per_s`), and by a correlated remainder. A load varies
    with the terrain (`terrain_share` of its variance, which changes the torque) and by sensor noise (which does not).
    """

    current_relative_std: SixNotNegative = (0.312, 0.388, 0.313, 0.365, 0.312, 0.351)
    load_relative_std: SixNotNegative = (0.142, 0.119, 0.096, 0.070, 0.067, 0.072)
    terrain_share: Fraction = 0.5
    terrain_length_m: Positive = 0.05
    slip_std: NotNegative = 0.002  # of the slip, varying with the terrain
    current_correlation_s: Positive = 0.2
    drops_per_s: NotNegative = 0.15
    drop_duration_s: Positive = 0.3
    drop_depth: Fraction = 0.7
    current_std_A: NotNegative = 0.001
    ground_speed_relative_std: NotNegative = 0.002
    angle_std_deg: NotNegative = 0.05
    yaw_rate_std_deg_s: NotNegative = 0.02

    @classmethod
    def none(cls) -> SensorNoise:
        """Return noise-free sensors on terrain without roughness."""
        return cls.model_validate(
            {name: 0.0 for name in cls.model_fields if name.endswith(("_std", "_std_A", "_std_deg", "_std_deg_s"))}
            | {"drops_per_s": 0.0}
        )


class BearingDrag(Table):
    """Additional current of one wheel's bearing from a time on."""

    wheel: WheelNumber
    from_s: NotNegative
    current_A: NotNegative


class LoadDrift(Table):
    """Linear drift of one load cell's reading."""

    wheel: WheelNumber
    newton_per_s: float


class Hidden(Table):
    """`[hidden]`: effects that are in no configuration of the daemon; 0: absent.

    Constant and viscous friction are in `[drivetrain]` as `no_load_current_A` and
    `viscous_current_A_s_per_rad`.
    """

    grade_resistance: NotNegative = 1.0
    cold_drag_A: NotNegative = 0.0  # at 0 °C; decreases by a factor e every 10 °C
    torque_constant_per_degC: float = 0.0  # relative change per degree, 0 at 20 °C
    ripple_A: NotNegative = 0.0
    ripple_order: Positive = 2.0  # cycles per wheel turn
    bearing_drag: BearingDrag | None = None
    load_drift: LoadDrift | None = None


class Scenario(Table):
    """The scenario file."""

    seed: int = 1
    ambient_degC: float = 15.0
    ground: Ground = Ground()
    motion: Motion = Motion()
    noise: SensorNoise = SensorNoise()
    hidden: Hidden = Hidden()
    drivetrain: Drivetrain = Drivetrain(no_load_current_A=(0.037,) * 6, viscous_current_A_s_per_rad=(4e-5,) * 6)
    wheel: Wheel = Wheel()
    rover: Rover = Rover()


def read_scenario(path: Path) -> Scenario:
    """Read a scenario.

    Raises
    ------
    OSError, tomllib.TOMLDecodeError, pydantic.ValidationError
        The file cannot be read, is not TOML, or has invalid keys or values.
    """
    return Scenario.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
