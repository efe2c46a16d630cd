"""Drives of several kinds: what a rover did, before anything is concealed and before any sensor adds noise.

A drive is made of legs. Each leg has a speed, some reverse, some stop, some turn; speeds ramp, yaw rates step. Slopes,
temperature and voltage wander by sums of slow sinusoids. `KINDS` differ in how much they excite.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from numpy.random import Generator

Array = NDArray[np.float64]

FORE_AFT = np.array([1.0, 1.0, 0.0, 0.0, -1.0, -1.0])
"""Where wheels 1–6 stand along the body: front, middle, rear."""
LEFT = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Which side: left +1, right −1."""


@dataclass(frozen=True)
class Habit:
    """How a kind of drive behaves: durations [s], wheel speeds [rad/s] and shares of legs."""

    leg_s: tuple[float, float]
    speed_rad_s: tuple[float, float]
    ramp_s: tuple[float, float]
    reverse: float
    stop: float
    turn: float


EVERYTHING = frozenset({"speed", "reverse", "stop", "turn", "slope", "temperature", "slip"})
"""What a drive may move."""

ASKS = {
    "speed": ("staircase", "speeds"),
    "reverse": ("backwards", "both ways", "reverse"),
    "stop": ("start, stop", "stand still"),
    "turn": ("turn on the spot", "arcs"),
    "slope": ("slope",),
    "temperature": ("cold", "warm"),
    "slip": ("sledge", "slip"),
    "ballast": ("ballast", "weights"),
    "lift": ("lift the wheels",),
}
"""What an experiment, told in words, asks to be moved."""

KINDS = {
    "patrol": Habit((8, 36), (0.08, 0.46), (2.0, 2.0), 0.10, 0.06, 0.35),
    "shuttle": Habit((20, 50), (0.10, 0.45), (1.5, 4.0), 0.45, 0.05, 0.15),
    "survey": Habit((40, 110), (0.08, 0.40), (2.0, 5.0), 0.15, 0.04, 0.30),
    "science-stops": Habit((8, 25), (0.07, 0.42), (1.0, 3.0), 0.20, 0.22, 0.25),
}


@dataclass(frozen=True)
class Drive:
    """What happened, sampled at `t_s` (n,): wheels in arrays (n, 6), the body in arrays (n,)."""

    kind: str
    t_s: Array
    wheel_speed_rad_s: Array
    slip: Array
    load_N: Array
    pitch_rad: Array
    roll_rad: Array
    yaw_rate_rad_s: Array
    temperature_degC: Array
    voltage_V: Array
    radius_m: float

    @property
    def hub_speed_m_s(self) -> Array:
        """Speed of each hub over ground [m/s], (n, 6)."""
        return self.radius_m * self.wheel_speed_rad_s * (1 - self.slip)

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Where a wheel turns fast enough for the simulation to speak: above 0.05 rad/s, (n, 6)."""
        return np.abs(self.wheel_speed_rad_s) > 0.05

    @property
    def rotation(self) -> Array:
        """Direction of rotation, −1 … 1, going through 0 within a few hundredths of rad/s, (n, 6)."""
        return np.tanh(self.wheel_speed_rad_s / 0.012)

    @property
    def wheel_angle_rad(self) -> Array:
        """How far each wheel has turned [rad], (n, 6)."""
        step = np.diff(self.t_s)[:, None]
        turned = np.cumsum(step * (self.wheel_speed_rad_s[1:] + self.wheel_speed_rad_s[:-1]) / 2, axis=0)
        return np.vstack([np.zeros((1, 6)), turned])


def wander(rng: Generator, t_s: Array, period_s: tuple[float, float], waves: int = 4) -> Array:
    """Return a slow random curve of unit rms: a sum of sinusoids with random periods and phases, (n,)."""
    total = np.zeros_like(t_s)
    for _ in range(waves):
        period = np.exp(rng.uniform(*np.log(period_s)))
        total += rng.uniform(0.4, 1.0) * np.sin(2 * np.pi * (t_s / period + rng.uniform()))
    return total / max(float(np.sqrt(np.mean(total**2))), 1e-9)


def coloured(rng: Generator, shape: tuple[int, ...], step_s: float, correlation_s: float) -> Array:
    """Return first-order autocorrelated noise of unit variance along axis 0."""
    from scipy.signal import lfilter  # noqa: PLC0415  # the rover's path imports this package's neighbours, not SciPy

    keep = np.exp(-step_s / correlation_s)
    fresh = rng.normal(size=shape) * np.sqrt(1 - keep**2)
    fresh[0] /= np.sqrt(1 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], fresh, axis=0), np.float64)


def legs(rng: Generator, habit: Habit, t_s: Array) -> tuple[Array, Array]:
    """Return the body's commanded wheel speed [rad/s] and yaw rate [rad/s], both (n,)."""
    end = float(t_s[-1])
    times, speeds, turns = [0.0], [0.0], []
    at, sign = 0.0, 1.0
    while at < end:
        lasts = rng.uniform(*habit.leg_s)
        sign = -sign if rng.uniform() < habit.reverse else sign
        wanted = 0.0 if rng.uniform() < habit.stop else sign * rng.uniform(*habit.speed_rad_s)
        ramp = min(rng.uniform(*habit.ramp_s), lasts / 2)
        times += [at + ramp, at + lasts]
        speeds += [wanted, wanted]
        if wanted and rng.uniform() < habit.turn:
            turns.append((at + rng.uniform(0, ramp), at + lasts * rng.uniform(0.5, 1), rng.uniform(-0.03, 0.03)))
        at += lasts
    speed = np.interp(t_s, times, speeds)
    yaw = np.zeros_like(t_s)
    for start, stop, rate in turns:
        yaw[(t_s >= start) & (t_s < stop)] = rate
    return speed, np.where(np.abs(speed) > 0.01, yaw, 0.0)


def temperatures(rng: Generator, t_s: Array) -> Array:
    """Return the six motors' temperatures [°C], (n, 6): warming, a cold start, or a day that cools again."""
    part = t_s / t_s[-1]
    trend = [30 * (part - 0.5), 34 * (1 - np.exp(-4 * part)) - 26, 18 * np.cos(2 * np.pi * (part - rng.uniform()))]
    shared = trend[rng.integers(3)] + rng.uniform(2, 5) * wander(rng, t_s, (250, 700)) + rng.uniform(-4, 6)
    return np.asarray(shared[:, None] + rng.normal(0, 0.8, 6), np.float64)


def loads(rng: Generator, t_s: Array, pitch: Array, roll: Array, mass_kg: float) -> Array:
    """Return the six wheels' loads [N], (n, 6): weight, its shift on slopes, and stones under the wheels."""
    # 9.81, not the solver's 9.80665: a change would alter the recordings of every seed.
    share = mass_kg * 9.81 / 6 * (1 + np.clip(rng.normal(0, 0.08, 6), -0.2, 0.2))
    shift = -rng.uniform(0.8, 1.3) * pitch[:, None] * FORE_AFT - rng.uniform(0.6, 1.1) * roll[:, None] * LEFT
    stones = rng.uniform(0.05, 0.09) * coloured(rng, (len(t_s), 6), t_s[1] - t_s[0], rng.uniform(0.8, 3.0))
    return np.asarray(np.clip(share * (1 + shift + stones), 5, None), np.float64)


def slips(rng: Generator, t_s: Array, pitch: Array) -> Array:
    """Return slip (n, 6): nearly shared, 0.02 at the least, sometimes growing uphill."""
    shared = rng.uniform(0.03, 0.08) * np.abs(wander(rng, t_s, (60, 260))) + rng.uniform(0.015, 0.035)
    uphill = rng.choice([0.0, 0.0, rng.uniform(0.1, 0.4)]) * np.clip(pitch, 0, None)
    apart = 1 + rng.uniform(0, 0.15) * coloured(rng, (len(t_s), 6), t_s[1] - t_s[0], 20.0)
    return np.asarray(np.clip((shared + uphill)[:, None] * apart, 0.003, 0.4), np.float64)


def moves_of(experiment: str) -> frozenset[str]:
    """Return what an experiment in words asks to be moved."""
    told = experiment.lower()
    return frozenset(move for move, words in ASKS.items() if any(word in told for word in words))


def lasting_s(experiment: str) -> float:
    """Return how long an experiment in words asks to drive: the longest time that it names [s], 0 where it does not."""
    return max((60.0 * float(minutes) for minutes in re.findall(r"(\d+) minutes", experiment)), default=0.0)


def asked_for(rng: Generator, moves: frozenset[str]) -> Habit:
    """Return a habit that moves what an experiment asks for, and nothing else: one speed where none are asked for."""
    one = rng.uniform(0.15, 0.4)
    speeds = (0.06, 0.46) if "speed" in moves else (one, one)
    return Habit(
        leg_s=(25, 50),
        speed_rad_s=speeds,
        ramp_s=(2, 3),
        reverse=0.5 if "reverse" in moves else 0.0,
        stop=0.3 if "stop" in moves else 0.0,
        turn=0.4 if "turn" in moves else 0.0,
    )


def make_drive(
    rng: Generator,
    kind: str,
    *,
    duration_s: float,
    step_s: float,
    radius_m: float,
    track_m: float,
    mass_kg: float,
    moves: frozenset[str] = EVERYTHING,
) -> Drive:
    """Return a drive of this kind; `constant` moves nothing and tells nothing apart, `experiment` what is asked for."""
    t_s: Array = np.arange(round(duration_s / step_s), dtype=np.float64) * step_s
    moved = frozenset[str]() if kind == "constant" else moves
    if kind == "constant":
        speed, yaw = np.full_like(t_s, rng.uniform(0.15, 0.4)), np.zeros_like(t_s)
    else:
        speed, yaw = legs(rng, KINDS[kind] if kind in KINDS else asked_for(rng, moved), t_s)
    hilly = float("slope" in moved)
    pitch = hilly * rng.uniform(0.04, 0.08) * wander(rng, t_s, (150, 500))
    roll = hilly * rng.uniform(0.03, 0.05) * wander(rng, t_s, (180, 550))
    warm = temperatures(rng, t_s)
    voltage = 25.2 - rng.uniform(0.5, 1.8) * t_s / t_s[-1] + rng.uniform(0.3, 0.6) * wander(rng, t_s, (60, 180))
    slip = slips(rng, t_s, pitch)
    load = loads(rng, t_s, pitch, roll, mass_kg)
    if "temperature" not in moved:
        warm = np.broadcast_to(warm.mean(axis=0), warm.shape)
    if "slip" not in moved:
        slip = np.full_like(slip, rng.uniform(0.02, 0.06))
    if "ballast" in moved and kind == "experiment":
        load = load * np.where(np.sin(2 * np.pi * t_s / 400) > 0, 1.0, 1.5)[:, None]
    if "lift" in moved and kind == "experiment":
        # The last third on a block: the wheels carry nothing, and the hubs stay where they are.
        lifted = t_s[:, None] > 2 / 3 * t_s[-1]
        load, slip = np.where(lifted, 0.0, load), np.where(lifted, 1.0, slip)
    return Drive(
        kind=kind,
        t_s=t_s,
        wheel_speed_rad_s=speed[:, None] - yaw[:, None] * LEFT * track_m / 2 / radius_m,
        slip=slip,
        load_N=load,
        pitch_rad=pitch,
        roll_rad=roll,
        yaw_rate_rad_s=yaw,
        temperature_degC=warm,
        voltage_V=voltage,
        radius_m=radius_m,
    )
