"""What to drive, and for how long, to tell effects apart that one recording cannot."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.inference.sensitivity import NINE_IN_TEN
from regolithd.calibration.mismatch.selection.subset_selection import PER_COEFFICIENT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.selection.subset_selection import Search, Term

SMALLEST = 0.05
"""Of the mean magnitude of the predicted channel: the least effect that an experiment is to show."""
REMAINS = 0.1
"""Of a friction's energy, outside what gain, cohesion and friction angle can imitate once speed and direction vary."""
MINUTES = (10, 120)
"""The least and the most to ask for: a rover's battery ends too."""

DRIVES = {
    "direction": "drive the same stretch forwards and backwards at one speed",
    "wheel_speed": "drive a staircase of at least four constant speeds, from creeping to full speed, both ways",
    "temperature": "start cold, warm up, stop until cold again and repeat, so that temperature does not follow time",
    "torque": "repeat at one speed with and without ballast, and up and down a slope",
    "wheel_acceleration": "start, stop and reverse sharply, twenty times",
    "wheel_angle": "drive straight at three constant speeds, sampled at four times the ripple's frequency",
    "pitch": "drive one slope up and down, forwards and backwards",
    "yaw_rate": "turn on the spot and along arcs of several radii, both ways",
    "slip": "pull a sledge of several weights on level ground, so that slip changes at constant load",
    "wheel_row": "drive one virgin lane, then twice more in the same ruts",
    "time": "drive back over the same ground, and lift the wheels and spin all six at one speed",
    "none": "stand still with the motors unpowered, then drive one stretch both ways",
}
"""For each covariate, the drive that moves it and nothing else."""
WHEELS_UP = "lift the wheels and spin all six at several speeds, both ways"


def experiment_for(search: Search, given: Sequence[Term], members: Sequence[Term]) -> str:
    """Return the drives that move each member's covariate alone, and how long they take.

    What gain, cohesion and friction angle may hide shows where there is no soil.
    """
    drives = [DRIVES[c] for c in dict.fromkeys(_covariate(member) for member in members) if c in DRIVES]
    if any(search.share_outside(given, member) < REMAINS for member in members):
        drives.append(WHEELS_UP)
    sentence = "; then ".join(drives)
    return f"{sentence[:1].upper()}{sentence[1:]}; {_minutes_needed(search)} minutes in all."


def _minutes_needed(search: Search) -> int:
    """Return how long a drive must last before an effect of the smallest size shows nine times in ten.

    A drive that moves the right covariates leaves about a tenth of an effect outside the free parameters' reach; each
    reading then adds to its gain what the noise of this recording lets it.
    """
    problem = search.dictionary.problem
    needed = (sqrt(search.threshold + PER_COEFFICIENT) + NINE_IN_TEN) ** 2
    readings = 60 / problem.recording.step_s
    gained = REMAINS * readings * float(search.weights.sum()) * (SMALLEST * problem.mean_size) ** 2
    return int(np.clip(5 * np.ceil(needed / gained / 5), *MINUTES))


def _covariate(term: Term) -> str:
    return term.group.candidate.covariate if term.group.candidate else term.name
