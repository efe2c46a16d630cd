"""Traverses of the simulated rover: true speeds, slips, loads, attitude, temperature and voltage over time.

A traverse is a sequence of legs. Each leg has a constant speed; some reverse, stop or turn. Speeds change in ramps, yaw
rates in steps. Slopes, temperature and voltage are sums of slow sinusoids. The kinds in `KINDS` differ in how much they
excite the dynamics.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.random import Generator

Array = NDArray[np.float64]

FORE_AFT = np.array([1.0, 1.0, 0.0, 0.0, -1.0, -1.0])
"""Longitudinal position of wheels 1–6: front 1, middle 0, rear −1."""
LEFT = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Side of wheels 1–6: left 1, right −1."""


@dataclass(frozen=True)
class DriveProfile:
    """Ranges of leg duration [s], wheel speed [rad/s], ramp duration [s]; shares of legs that reverse, stop, turn."""

    leg_s: tuple[float, float]
    speed_rad_s: tuple[float, float]
    ramp_s: tuple[float, float]
    reverse: float
    stop: float
    turn: float


ALL_CONDITIONS = frozenset({"speed", "reverse", "stop", "turn", "slope", "temperature", "slip"})
"""Conditions that an ordinary traverse varies."""

CONDITIONS_OF = {
    "wheel_speed": {"speed"},
    "direction": {"reverse"},
    "wheel_acceleration": {"stop", "reverse"},
    "yaw_rate": {"turn"},
    "pitch": {"slope"},
    "roll": {"slope"},
    "temperature": {"temperature"},
    "slip": {"slip", "ballast"},
    "torque": {"slope", "ballast"},
    "load": {"ballast"},
}
"""The conditions that vary a covariate; none varies the others."""
UNLOADED = frozenset({"lift", "speed", "reverse"})
"""Conditions of a drive with the wheels lifted: they spin at several speeds, both ways."""

KINDS = {
    "patrol": DriveProfile((8, 36), (0.08, 0.46), (2.0, 2.0), 0.10, 0.06, 0.35),
    "shuttle": DriveProfile((20, 50), (0.10, 0.45), (1.5, 4.0), 0.45, 0.05, 0.15),
    "survey": DriveProfile((40, 110), (0.08, 0.40), (2.0, 5.0), 0.15, 0.04, 0.30),
    "science-stops": DriveProfile((8, 25), (0.07, 0.42), (1.0, 3.0), 0.20, 0.22, 0.25),
}


@dataclass(frozen=True)
class Traverse:
    """True state of the rover at the times `t_s` (n,): wheels in arrays (n, 6), the body in arrays (n,)."""

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
        """Whether a wheel turns faster than 0.05 rad/s, below which the simulation predicts nothing, (n, 6)."""
        return np.abs(self.wheel_speed_rad_s) > 0.05

    @property
    def rotation(self) -> Array:
        """Direction of rotation, −1 … 1, smooth within a few hundredths of rad/s about standstill, (n, 6)."""
        return np.tanh(self.wheel_speed_rad_s / 0.012)

    @property
    def wheel_angle_rad(self) -> Array:
        """Angle that each wheel has turned [rad], (n, 6)."""
        step = np.diff(self.t_s)[:, None]
        turned = np.cumsum(step * (self.wheel_speed_rad_s[1:] + self.wheel_speed_rad_s[:-1]) / 2, axis=0)
        return np.vstack([np.zeros((1, 6)), turned])


def slow_variation(rng: Generator, t_s: Array, period_s: tuple[float, float], waves: int = 4) -> Array:
    """Return a slowly varying random curve of unit rms: sinusoids with random periods and phases, (n,)."""
    total = np.zeros_like(t_s)
    for _ in range(waves):
        period = np.exp(rng.uniform(*np.log(period_s)))
        total += rng.uniform(0.4, 1.0) * np.sin(2 * np.pi * (t_s / period + rng.uniform()))
    return total / max(float(np.sqrt(np.mean(total**2))), 1e-9)


def autocorrelated_noise(rng: Generator, shape: tuple[int, ...], step_s: float, correlation_s: float) -> Array:
    """Return first-order autocorrelated noise of unit variance along axis 0."""
    from scipy.signal import lfilter  # noqa: PLC0415  # SciPy is not installed on the rover

    keep = np.exp(-step_s / correlation_s)
    fresh = rng.normal(size=shape) * np.sqrt(1 - keep**2)
    fresh[0] /= np.sqrt(1 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], fresh, axis=0), np.float64)


def legs(rng: Generator, profile: DriveProfile, t_s: Array) -> tuple[Array, Array]:
    """Return the body's commanded wheel speed [rad/s] and yaw rate [rad/s], both (n,)."""
    end = float(t_s[-1])
    times, speeds, turns = [0.0], [0.0], []
    at, sign = 0.0, 1.0
    while at < end:
        lasts = rng.uniform(*profile.leg_s)
        sign = -sign if rng.uniform() < profile.reverse else sign
        wanted = 0.0 if rng.uniform() < profile.stop else sign * rng.uniform(*profile.speed_rad_s)
        ramp = min(rng.uniform(*profile.ramp_s), lasts / 2)
        times += [at + ramp, at + lasts]
        speeds += [wanted, wanted]
        if wanted and rng.uniform() < profile.turn:
            turns.append((at + rng.uniform(0, ramp), at + lasts * rng.uniform(0.5, 1), rng.uniform(-0.03, 0.03)))
        at += lasts
    speed = np.interp(t_s, times, speeds)
    yaw = np.zeros_like(t_s)
    for start, stop, rate in turns:
        yaw[(t_s >= start) & (t_s < stop)] = rate
    return speed, np.where(np.abs(speed) > 0.01, yaw, 0.0)


def temperatures(rng: Generator, t_s: Array) -> Array:
    """Return the six motors' temperatures [°C], (n, 6): steady warming, a cold start, or a daily cycle."""
    part = t_s / t_s[-1]
    trend = [30 * (part - 0.5), 34 * (1 - np.exp(-4 * part)) - 26, 18 * np.cos(2 * np.pi * (part - rng.uniform()))]
    shared = trend[rng.integers(3)] + rng.uniform(2, 5) * slow_variation(rng, t_s, (250, 700)) + rng.uniform(-4, 6)
    return np.asarray(shared[:, None] + rng.normal(0, 0.8, 6), np.float64)


def loads(rng: Generator, t_s: Array, pitch: Array, roll: Array, mass_kg: float) -> Array:
    """Return the six wheels' loads [N], (n, 6): weight, its shift on slopes, and roughness of the ground."""
    # 9.81, not the solver's 9.80665: a change would alter the recordings of every seed.
    share = mass_kg * 9.81 / 6 * (1 + np.clip(rng.normal(0, 0.08, 6), -0.2, 0.2))
    shift = -rng.uniform(0.8, 1.3) * pitch[:, None] * FORE_AFT - rng.uniform(0.6, 1.1) * roll[:, None] * LEFT
    roughness = rng.uniform(0.05, 0.09) * autocorrelated_noise(
        rng, (len(t_s), 6), t_s[1] - t_s[0], rng.uniform(0.8, 3.0)
    )
    return np.asarray(np.clip(share * (1 + shift + roughness), 5, None), np.float64)


def slips(rng: Generator, t_s: Array, pitch: Array) -> Array:
    """Return slip (n, 6): mostly common to the wheels, at least about 0.02, sometimes increasing uphill."""
    shared = rng.uniform(0.03, 0.08) * np.abs(slow_variation(rng, t_s, (60, 260))) + rng.uniform(0.015, 0.035)
    uphill = rng.choice([0.0, 0.0, rng.uniform(0.1, 0.4)]) * np.clip(pitch, 0, None)
    differences = 1 + rng.uniform(0, 0.15) * autocorrelated_noise(rng, (len(t_s), 6), t_s[1] - t_s[0], 20.0)
    return np.asarray(np.clip((shared + uphill)[:, None] * differences, 0.003, 0.4), np.float64)


@dataclass(frozen=True)
class ProposedExperiment:
    """What an answer proposes to record, from `vary`, `duration_s` and `lift` of its indistinguishable sets."""

    vary: frozenset[str]
    duration_s: float
    lift: bool

    @classmethod
    def of_answer(cls, answer: Mapping[str, Any]) -> ProposedExperiment | None:
        """Return one experiment for all sets of an answer's JSON; None where it has no set."""
        sets = answer.get("indistinguishable", [])
        if not sets:
            return None
        vary = frozenset(name for one in sets for name in one["vary"])
        return cls(vary, max(one["duration_s"] for one in sets), any(one["lift"] for one in sets))

    @property
    def conditions(self) -> frozenset[str]:
        """The conditions of a traverse that it varies."""
        varied = frozenset[str]().union(*(CONDITIONS_OF.get(name, ()) for name in self.vary))
        return varied | UNLOADED if self.lift else varied


def experiment_profile(rng: Generator, varied: frozenset[str]) -> DriveProfile:
    """Return a profile that varies only what an experiment asks for: one constant speed if it asks for no others."""
    one = rng.uniform(0.15, 0.4)
    speeds = (0.06, 0.46) if "speed" in varied else (one, one)
    return DriveProfile(
        leg_s=(25, 50),
        speed_rad_s=speeds,
        ramp_s=(2, 3),
        reverse=0.5 if "reverse" in varied else 0.0,
        stop=0.3 if "stop" in varied else 0.0,
        turn=0.4 if "turn" in varied else 0.0,
    )


def make_traverse(
    rng: Generator,
    kind: str,
    *,
    duration_s: float,
    step_s: float,
    radius_m: float,
    track_m: float,
    mass_kg: float,
    varied: frozenset[str] = ALL_CONDITIONS,
) -> Traverse:
    """Return a traverse of this kind; `constant` varies no condition, `experiment` those of `varied` alone."""
    t_s: Array = np.arange(round(duration_s / step_s), dtype=np.float64) * step_s
    changing = frozenset[str]() if kind == "constant" else varied
    if kind == "constant":
        speed, yaw = np.full_like(t_s, rng.uniform(0.15, 0.4)), np.zeros_like(t_s)
    else:
        speed, yaw = legs(rng, KINDS[kind] if kind in KINDS else experiment_profile(rng, changing), t_s)
    hilly = float("slope" in changing)
    pitch = hilly * rng.uniform(0.04, 0.08) * slow_variation(rng, t_s, (150, 500))
    roll = hilly * rng.uniform(0.03, 0.05) * slow_variation(rng, t_s, (180, 550))
    warm = temperatures(rng, t_s)
    voltage = 25.2 - rng.uniform(0.5, 1.8) * t_s / t_s[-1] + rng.uniform(0.3, 0.6) * slow_variation(rng, t_s, (60, 180))
    slip = slips(rng, t_s, pitch)
    load = loads(rng, t_s, pitch, roll, mass_kg)
    if "temperature" not in changing:
        warm = np.broadcast_to(warm.mean(axis=0), warm.shape)
    if "slip" not in changing:
        slip = np.full_like(slip, rng.uniform(0.02, 0.06))
    if "ballast" in changing and kind == "experiment":
        load = load * np.where(np.sin(2 * np.pi * t_s / 400) > 0, 1.0, 1.5)[:, None]
    if "lift" in changing and kind == "experiment":
        # In the last third the rover stands on a block: no load on the wheels, no speed of the hubs.
        lifted = t_s[:, None] > 2 / 3 * t_s[-1]
        load, slip = np.where(lifted, 0.0, load), np.where(lifted, 1.0, slip)
    return Traverse(
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
