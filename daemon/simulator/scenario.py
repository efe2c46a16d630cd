"""What the virtual rover drives on, what it is made of, and how badly it measures: one TOML file, all of it optional.

    seed = 7
    [[ground.stretches]]
    soil = "sandy-loam"
    until_m = 5.0
    [[ground.stretches]]
    soil = "clayey-soil"
    [noise]
    drops_per_s = 0.0

Tables that `rover.toml` has too are the same models. The defaults are Kapvik on its field trip.
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
    """Return the soil of that name; a whole table is taken as it is."""
    if not isinstance(value, str):
        return value
    if value not in SOILS:
        raise ValueError(f"no soil is called {value!r}; known are {', '.join(SOILS)}")
    return SOILS[value]


class Stretch(Table):
    """The ground up to a place, in metres from where the rover's middle starts; the last stretch has no end."""

    soil: Annotated[Soil, BeforeValidator(_named_soil)]
    until_m: float | None = None

    @property
    def name(self) -> str:
        """The soil's name in Table 1, or what it consists of."""
        for name, soil in SOILS.items():
            if soil == self.soil:
                return name
        return f"c = {self.soil.cohesion_Pa:g} Pa, φ = {self.soil.friction_angle_deg:g}°"


class Ground(Table):
    """`[ground]`: soils along the way, and the way's slope: a constant one with gentle waves on it."""

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
    """`[motion]`: how the rover slips. Prescribed, not solved from the drawbar pull, which the wheel model leaves open.

    `slip` is on the level; `slip_per_grade` times the sine of the pitch comes on top.
    """

    slip: Annotated[float, Field(gt=-0.5, lt=0.9)] = 0.025
    slip_per_grade: NotNegative = 0.3
    centre_of_mass_m: Positive = 0.2


class Noise(Table):
    """`[noise]`: the relative standard deviations of Tables 4 and 6 (prepared ground), as totals of their parts.

    A current varies because the load does, by `drops_per_s` momentary drops, and by the rest. A load varies with the
    ground (`terrain_share` of its variance, which the wheel feels) and by the sensor's own noise (which it does not).
    """

    current_relative_std: SixNotNegative = (0.312, 0.388, 0.313, 0.365, 0.312, 0.351)
    load_relative_std: SixNotNegative = (0.142, 0.119, 0.096, 0.070, 0.067, 0.072)
    terrain_share: Fraction = 0.5
    terrain_length_m: Positive = 0.05
    slip_std: NotNegative = 0.002  # of the slip itself, with the ground
    current_correlation_s: Positive = 0.2
    drops_per_s: NotNegative = 0.15
    drop_duration_s: Positive = 0.3
    drop_depth: Fraction = 0.7
    current_std_A: NotNegative = 0.001
    ground_speed_relative_std: NotNegative = 0.002
    angle_std_deg: NotNegative = 0.05
    yaw_rate_std_deg_s: NotNegative = 0.02

    @classmethod
    def none(cls) -> Noise:
        """Return perfect sensors on perfectly even ground."""
        return cls.model_validate(
            {name: 0.0 for name in cls.model_fields if name.endswith(("_std", "_std_A", "_std_deg", "_std_deg_s"))}
            | {"drops_per_s": 0.0}
        )


class BearingDrag(Table):
    """One wheel's bearing that drags from some time on."""

    wheel: WheelNumber
    from_s: NotNegative
    current_A: NotNegative


class LoadDrift(Table):
    """One load cell that wanders."""

    wheel: WheelNumber
    newton_per_s: float


class Hidden(Table):
    """`[hidden]`: physics that no configuration tells the daemon; 0 where there is none.

    Constant and speed-dependent friction stand in `[drivetrain]` as `no_load_current_A` and
    `viscous_current_A_s_per_rad`.
    """

    grade_resistance: NotNegative = 1.0
    cold_drag_A: NotNegative = 0.0  # at 0 °C; falls by e every 10 °C
    torque_constant_per_degC: float = 0.0  # from 20 °C on
    ripple_A: NotNegative = 0.0
    ripple_order: Positive = 2.0  # cycles per wheel turn
    bearing_drag: BearingDrag | None = None
    load_drift: LoadDrift | None = None


class Scenario(Table):
    """The whole file."""

    seed: int = 1
    ambient_degC: float = 15.0
    ground: Ground = Ground()
    motion: Motion = Motion()
    noise: Noise = Noise()
    hidden: Hidden = Hidden()
    drivetrain: Drivetrain = Drivetrain(no_load_current_A=(0.037,) * 6, viscous_current_A_s_per_rad=(4e-5,) * 6)
    wheel: Wheel = Wheel()
    rover: Rover = Rover()


def read_scenario(path: Path) -> Scenario:
    """Read a scenario.

    Raises
    ------
    OSError, tomllib.TOMLDecodeError, pydantic.ValidationError
        The file cannot be read, is no TOML, or says what cannot be.
    """
    return Scenario.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
