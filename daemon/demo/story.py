"""What the demo drives and conceals: a long drive that is computed, then the border between two soils, live.

| part | where | what it is for |
|---|---|---|
| legs at several speeds, to and fro | firm soil, computed | the comparison needs different speeds |
| `STEADY_S` at the speed of the crossing | firm soil, computed | the alarm's reference: two minutes |
| `LIVE_S` | from firm to weak soil, live on the bus | front, middle and rear axle cross, 15 s apart |

The daemon and the simulation know of no viscous drag; the virtual rover has one, as cold grease has.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.parameters import SOILS
from regolithd.daemon.simulator.scenario import Ground, Hidden, Scenario, Stretch
from regolithd.daemon.simulator.virtual_rover import AHEAD

if TYPE_CHECKING:
    from regolithd.daemon.pipeline.snapshot import Array

FIRM, WEAK = "medium-soil", "lete-sand"
SPEED_M_S = 0.022
"""Kapvik's speed in its field trial."""
LEGS_M_S = (0.012, 0.045, -0.022, 0.034, -0.045, -0.012, 0.028, -0.034)
LEG_S, LEG_ROUNDS, RAMP_S = 45.0, 2, 2.0
STEADY_S = 150.0
LIVE_S = 44.0
BEFORE_BORDER_S = 4.0
"""Of the live part, until the front axle reaches the weak soil."""
CONCEALED_A_S_PER_RAD = 4e-5
SEED = 3


@dataclass(frozen=True, slots=True, eq=False)
class FastPart:
    """Wheel speed [rad/s] at each SYNC [s] of the part that is computed; shape (instants,)."""

    time_s: Array
    wheel_speed_rad_s: Array

    def distance_m(self, radius_m: float, slip: float) -> float:
        """Return how far the rover is from its start at the end."""
        step_s = float(self.time_s[1] - self.time_s[0])
        return float(np.sum(self.wheel_speed_rad_s)) * step_s * radius_m * (1 - slip)


def fast_part(rate_Hz: float, radius_m: float) -> FastPart:
    """Return the legs and the steady drive."""
    times, speeds = [0.0], [0.0]
    for number, speed in enumerate(LEGS_M_S * LEG_ROUNDS):
        times += [number * LEG_S + RAMP_S, (number + 1) * LEG_S]
        speeds += [speed, speed]
    end_s = times[-1] + STEADY_S
    times += [times[-1] + RAMP_S, end_s]
    speeds += [SPEED_M_S, SPEED_M_S]
    time_s = np.arange(round(end_s * rate_Hz)) / rate_Hz
    return FastPart(time_s, np.interp(time_s, times, speeds) / radius_m)


def story_scenario(fast: FastPart) -> Scenario:
    """Return the scenario whose border lies `BEFORE_BORDER_S` ahead of the front axle at the end of the fast part."""
    plain = Scenario()
    slip, rover = plain.motion.slip, plain.rover
    driven = fast.distance_m(plain.wheel.radius_m, slip)
    border = driven + BEFORE_BORDER_S * SPEED_M_S * (1 - slip) + float(AHEAD.max()) * rover.wheelbase_m
    return Scenario(
        seed=SEED,
        ground=Ground(
            stretches=(Stretch(soil=SOILS[FIRM], until_m=border), Stretch(soil=SOILS[WEAK])),
            wave_deg=3.0,
            wave_length_m=4.0,
        ),
        hidden=Hidden(grade_resistance=0.0),
        drivetrain=plain.drivetrain.model_copy(update={"viscous_current_A_s_per_rad": (CONCEALED_A_S_PER_RAD,) * 6}),
    )
