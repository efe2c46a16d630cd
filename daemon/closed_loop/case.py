"""The cases of the study: which drivetrain effect is hidden, and what `rover.toml` and `SIM.toml` contain.

A case has a scenario (the ground truth), a `rover.toml` (the daemon's configuration) and a `SIM.toml` (the simulation's
parameters). The seed draws the size of the hidden effect, and gain and soil within their stated uncertainties.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.parameters import SOILS, Drivetrain
from regolithd.daemon.simulator.scenario import Ground, Hidden, Scenario, Stretch

if TYPE_CHECKING:
    from collections.abc import Mapping

NO_LOAD_A = 0.037
"""No-load current of the Maxon RE 25."""
VISCOUS_A_S_PER_RAD = 4e-5
SIZE_SPREAD = 0.15
"""The hidden effect's size is drawn within this fraction of its nominal value."""
STATED_STD = 0.03
"""Relative standard deviations of gain, cohesion and friction angle, as stated before the comparison."""
NO_LOAD_STD_A = 0.001
"""Standard deviation of a no-load current from a wheels-up spin."""
KNOWN_SOIL = "sandy-loam"
OTHER_SOILS = ("lete-sand", "clayey-soil", "medium-soil")
STRETCH_M = 4.5


@dataclass(frozen=True, slots=True)
class Case:
    """One case.

    Attributes
    ----------
    name, title
        For figures and folders; for people.
    known
        Keys of `[drivetrain]` that `rover.toml` and `SIM.toml` contain.
    hidden
        Keys of `[drivetrain]` that only the scenario contains.
    names
        The effects that the comparison should name.
    """

    name: str
    title: str
    known: Mapping[str, float]
    hidden: Mapping[str, float]
    names: tuple[str, ...]


def cases(seed: int) -> tuple[Case, ...]:
    """Return the three cases: constant friction hidden, viscous friction hidden, nothing hidden."""
    random = np.random.default_rng([seed, 3])
    constant, viscous = 1 + SIZE_SPREAD * random.uniform(-1, 1, 2)
    bench = {"no_load_current_A": NO_LOAD_A, "no_load_current_std_A": NO_LOAD_STD_A}
    return (
        Case(
            "coulomb",
            "constant friction hidden",
            {},
            {"no_load_current_A": NO_LOAD_A * constant},
            ("coulomb-friction",),
        ),
        Case(
            "viscous",
            "viscous friction hidden",
            bench,
            {"viscous_current_A_s_per_rad": VISCOUS_A_S_PER_RAD * viscous},
            ("viscous-friction",),
        ),
        Case("nothing", "nothing hidden", bench, {}, ()),
    )


def first_scenario(case: Case, seed: int) -> Scenario:
    """Return the scenario of the first drive: one known soil, slopes of a few degrees.

    The wheel–soil model has no grade resistance, so it is 0 here: only the case's effect is hidden.
    """
    moved = np.clip(np.random.default_rng([seed, 4]).standard_normal(3), -2, 2) * STATED_STD + 1
    stated = SOILS[KNOWN_SOIL]
    soil = stated.model_copy(
        update={
            "cohesion_Pa": stated.cohesion_Pa * moved[0],
            "friction_angle_deg": stated.friction_angle_deg * moved[1],
        }
    )
    known = {name: value for name, value in case.known.items() if not name.endswith("_std_A")}
    drivetrain = Drivetrain.model_validate({**known, **case.hidden, "gain_factor": float(moved[2])})
    return Scenario(
        seed=seed,
        ground=Ground(stretches=(Stretch(soil=soil),), wave_deg=4.0, wave_length_m=4.0),
        hidden=Hidden(grade_resistance=0.0),
        drivetrain=drivetrain,
    )


def second_scenario(first: Scenario, stretch_m: float = STRETCH_M) -> Scenario:
    """Return the scenario of the second drive: the same rover on three other soils, `stretch_m` each."""
    ends = [stretch_m * (k + 1) for k in range(len(OTHER_SOILS) - 1)]
    stretches = tuple(
        Stretch(soil=SOILS[name], until_m=end) for name, end in zip(OTHER_SOILS, [*ends, None], strict=True)
    )
    ground = first.ground.model_copy(update={"stretches": stretches, "wave_deg": 1.5})
    return first.model_copy(update={"ground": ground, "seed": first.seed + 1})


def rover_toml(case: Case) -> str:
    """Return the daemon's configuration."""
    return "\n".join(
        [
            "# Configuration of the virtual rover before the comparison.",
            "[nodes]",
            "inclinometer = 21",
            "ground_speed = 22",
            "",
            "[drivetrain]                # constants of Eq. 11: the defaults",
            f"gain_relative_std = {STATED_STD}",
            *(f"{name} = {value}" for name, value in case.known.items()),
            "",
        ]
    )


def sim_toml(case: Case) -> str:
    """Return the simulation's parameters: the same drivetrain, and the known soil."""
    soil = SOILS[KNOWN_SOIL].model_dump() | {
        "cohesion_relative_std": STATED_STD,
        "friction_angle_relative_std": STATED_STD,
    }
    return "\n".join(
        [
            "[simulation]",
            'model = "rover-wheel"',
            "",
            "[drivetrain]",
            f"gain_relative_std = {STATED_STD}",
            *(f"{name} = {value}" for name, value in case.known.items()),
            "",
            "[soil]",
            *(f"{name} = {value}" for name, value in soil.items()),
            "",
            "[sensors]",
            "load_relative_std = 0.07",
            "ground_speed_relative_std = 0.002",
            "pitch_std_rad = 0.001",
            "roll_std_rad = 0.001",
            "yaw_rate_std_rad_s = 0.0003",
            "",
        ]
    )
