"""Detects a change of soil: `calibration.posterior.change_detection`, fed with half-second means of six wheels."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.parameters import SOILS
from regolithd.calibration.posterior import change_detection as change
from regolithd.calibration.terrain.wheel_soil import contact_angle, wheel_torque

if TYPE_CHECKING:
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.snapshot import Array, SoilChange

REFERENCE = SOILS["sandy-loam"]
"""How torque follows load and slip; how large it is, the detector learns on the way."""


class SoilChangeDetector:
    """The detector for one rover. After an alarm it begins anew: what it knew was of the old soil."""

    def __init__(self, configuration: Configuration) -> None:
        self._wheel = configuration.wheel
        self._threshold = configuration.change.threshold
        self._state = change.start()

    def step(self, time_ns: int, load_N: Array, slip: Array, torque_Nm: Array) -> change.Alarm | None:
        """Take one half second's means, shape (6,), NaN where a wheel stood or was not measured."""
        angle = contact_angle(load_N, slip, self._wheel, REFERENCE)
        expected = wheel_torque(angle, slip, self._wheel, REFERENCE)
        self._state, _ = change.step(self._state, torque_Nm, expected)
        alarm = change.alarm(self._state, time_ns, self._threshold)
        if alarm is not None:
            self._state = change.start()
        return alarm


def change_text(changed: SoilChange) -> str:
    """Return an alarm with its evidence, in one sentence."""
    alarm = changed.alarm
    what = "gives way: torque fell" if alarm.direction == "fall" else "resists more: torque rose"
    ago_s = (alarm.time_ns - alarm.onset_ns) / 1e9
    wheels = {"all": "all wheels", "front": "the front wheels", "front-and-middle": "the front and middle wheels"}
    likely = ""
    if (fall := changed.fall) is not None:
        likely = (
            f"; that it fell is {100 * fall.cohesion:.0f} % likely of the cohesion, {100 * fall.friction_angle:.0f} % "
            f"of the friction angle, {100 * fall.drawbar_margin:.0f} % of the drawbar margin"
        )
    return (
        f"the soil {what} to {100 * alarm.torque_ratio:.0f} % of what load and slip let expect, since {ago_s:g} s, "
        f"under {wheels.get(alarm.group, alarm.group)} (score {alarm.statistic:.1f}, alarm at {alarm.threshold:g})"
        f"{likely}"
    )
