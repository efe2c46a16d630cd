"""What is concealed in each run of the loop, and what its rover and its simulation are told.

A run has a world (the truth), a `rover.toml` (what the daemon knows) and a `SIM.toml` (what the simulation knows). The
seed moves the size of what is concealed, and puts the world's gain and soil where the stated uncertainties allow.
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
"""Maxon RE 25: what turns the motor alone."""
VISCOUS_A_S_PER_RAD = 4e-5
SIZE_WITHIN = 0.15
STATED_STD = 0.03
"""How well gain, cohesion and friction angle are known before: relative."""
NO_LOAD_STD_A = 0.001
"""How well a wheels-up spin tells the no-load current."""
KNOWN_SOIL = "sandy-loam"
OTHER_SOILS = ("lete-sand", "clayey-soil", "medium-soil")
STRETCH_M = 4.5


@dataclass(frozen=True, slots=True)
class Case:
    """One run. `hidden` names the drivetrain terms that neither `rover.toml` nor `SIM.toml` has, with their size."""

    name: str
    title: str
    known: Mapping[str, float]
    hidden: Mapping[str, float]
    names: tuple[str, ...]


def cases(seed: int) -> tuple[Case, ...]:
    """Return constant friction concealed, viscous friction concealed, and nothing."""
    random = np.random.default_rng([seed, 3])
    constant, viscous = 1 + SIZE_WITHIN * random.uniform(-1, 1, 2)
    bench = {"no_load_current_A": NO_LOAD_A, "no_load_current_std_A": NO_LOAD_STD_A}
    return (
        Case(
            "coulomb",
            "constant friction concealed",
            {},
            {"no_load_current_A": NO_LOAD_A * constant},
            ("coulomb-friction",),
        ),
        Case(
            "viscous",
            "viscous friction concealed",
            bench,
            {"viscous_current_A_s_per_rad": VISCOUS_A_S_PER_RAD * viscous},
            ("viscous-friction",),
        ),
        Case("nothing", "nothing concealed", bench, {}, ()),
    )


def world(case: Case, seed: int) -> Scenario:
    """Return the world of the first drive: one known soil, gentle slopes up and down.

    The wheel–soil model has no weight along the slope, so the world has none here: one thing is concealed at a time.
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


def elsewhere(first: Scenario, stretch_m: float = STRETCH_M) -> Scenario:
    """Return the world of the second drive: the same rover on soils that the first has not."""
    ends = [stretch_m * (k + 1) for k in range(len(OTHER_SOILS) - 1)]
    stretches = tuple(
        Stretch(soil=SOILS[name], until_m=end) for name, end in zip(OTHER_SOILS, [*ends, None], strict=True)
    )
    ground = first.ground.model_copy(update={"stretches": stretches, "wave_deg": 1.5})
    return first.model_copy(update={"ground": ground, "seed": first.seed + 1})


def rover_toml(case: Case) -> str:
    """Return what the daemon is told."""
    return "\n".join(
        [
            "# The virtual rover, as its daemon knows it before the comparison.",
            "[nodes]",
            "inclinometer = 21",
            "ground_speed = 22",
            "",
            "[drivetrain]                # Eq. 11 has the defaults' constants",
            f"gain_relative_std = {STATED_STD}",
            *(f"{name} = {value}" for name, value in case.known.items()),
            "",
        ]
    )


def sim_toml(case: Case) -> str:
    """Return what the simulation is told: the same drivetrain, and the known soil."""
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
