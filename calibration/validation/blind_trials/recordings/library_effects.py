"""The sixteen effects that a solver can name, each by another law than the solver's candidate has.

For example: the Stribeck friction is a rational function of speed, grease follows Vogel's viscosity law, ripple has a
second harmonic, a soil changes over decimetres of ground, a bearing wears by a power of time, turning resistance
follows the slip angle of each axle, a load cell drifts as a random walk.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from regolithd.calibration.validation.blind_trials.recordings.concealed_effect import (
    EVERY_WHEEL,
    ConcealedEffect,
    TrueModel,
    on_wheels,
    some_wheels,
)
from regolithd.calibration.validation.blind_trials.recordings.ground import TorqueTable
from regolithd.calibration.validation.blind_trials.recordings.traverse import FORE_AFT, autocorrelated_noise

Array = NDArray[np.float64]
Maker = Callable[[Generator, TrueModel], ConcealedEffect]


def _drag(name: str, covariate: str, shape: Array, wheels: tuple[int, ...] = EVERY_WHEEL) -> ConcealedEffect:
    """Return an effect whose current [A] is proportional to its size."""
    return ConcealedEffect(name, name, covariate, lambda size: size * shape * on_wheels(wheels), wheels)


def coulomb(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Coulomb friction: constant drag that differs by up to a few percent between wheels."""
    differences = 1 + rng.uniform(0, 0.1) * rng.normal(size=6)
    effect = _drag("coulomb-friction", "direction", model.traverse.rotation * differences, some_wheels(rng))
    at = [wheel - 1 for wheel in effect.wheels]
    return replace(effect, parameters=lambda size: {"coulomb_current": size * float(np.mean(differences[at]))})


def viscous(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Viscous friction: drag proportional to a power of speed near one."""
    speed = np.abs(model.traverse.wheel_speed_rad_s)
    power = rng.uniform(0.9, 1.1)
    return _drag("viscous-friction", "wheel_speed", model.traverse.rotation * speed**power, some_wheels(rng))


def stribeck(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Stribeck friction: additional drag near standstill, a rational function of speed."""
    fades_rad_s = rng.uniform(0.08, 0.16)
    ratio = np.abs(model.traverse.wheel_speed_rad_s) / fades_rad_s
    return _drag("stribeck-friction", "wheel_speed", model.traverse.rotation / (1 + ratio ** rng.uniform(2, 3)))


def cold_lubricant(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Cold lubricant: drag proportional to the viscosity (Vogel's law) above its value at 45 °C."""
    celsius = np.clip(model.traverse.temperature_degC, -40, 60)
    steep, pole = rng.uniform(500, 900), rng.uniform(-120, -95)

    def viscosity(at: Array | float) -> Array:
        return np.asarray(np.exp(steep / (np.asarray(at) - pole) - steep / (-20 - pole)), np.float64)

    extra = viscosity(celsius) - viscosity(45.0)
    return _drag("cold-lubricant-friction", "temperature", model.traverse.rotation * extra)


def load_dependent(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Load-dependent efficiency: losses that increase faster than the torque."""
    current = model.current_A
    relative = np.abs(current) / model.mean_current_A
    shape = np.sign(current) * relative ** rng.uniform(1.8, 2.4) * model.mean_current_A
    return _drag("load-dependent-efficiency", "torque", shape)


def torque_constant(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Torque constant: decreases with the temperature above 20 °C, with a small quadratic term."""
    temperature_rise = model.traverse.temperature_degC - 20
    curve = rng.uniform(-0.002, 0.002)

    def current(size: float) -> Array:
        weakened = 1 - size * temperature_rise * (1 + curve * temperature_rise)
        return model.current_A * (1 / np.clip(weakened, 0.4, 2.5) - 1)

    name = "torque-constant-temperature"
    return ConcealedEffect(name, name, "temperature", current, largest=0.02)


def rotor_inertia(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Rotor inertia: current proportional to the acceleration, delayed by a fraction of a second by compliance."""
    traverse = model.traverse
    step = traverse.t_s[1] - traverse.t_s[0]
    acceleration = np.gradient(traverse.wheel_speed_rad_s, traverse.t_s, axis=0)
    lag = np.exp(-np.arange(6) * step / rng.uniform(0.08, 0.25))
    late = np.apply_along_axis(lambda row: np.convolve(row, lag / lag.sum())[: len(row)], 0, acceleration)
    return _drag("rotor-inertia", "wheel_acceleration", late)


def ripple(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Ripple of grousers or gears: periodic in the wheel angle, with a second harmonic and a phase for each wheel."""
    order = int(rng.integers(3, 20))
    phase, overtone = rng.uniform(0, 2 * np.pi, 6), rng.uniform(0, 0.35)
    angle = order * model.traverse.wheel_angle_rad + phase
    shape = np.abs(model.traverse.rotation) * (np.sin(angle) + overtone * np.sin(2 * angle + rng.uniform(0, 6)))
    effect = _drag("wheel-angle-ripple", "wheel_angle", shape)
    return replace(effect, parameters=lambda _: {"order": float(order)})


def grade(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Grade resistance: weight along the slope, shared by load or equally; zero at standstill."""
    traverse = model.traverse
    share = traverse.load_N / traverse.load_N.mean() if rng.uniform() < 0.5 else np.ones((1, 6))
    uphill = np.sin(traverse.pitch_rad)[:, None] * share * np.abs(traverse.rotation)
    return _drag("grade-resistance", "pitch", uphill)


def turning(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Model turning resistance: it depends on the slip angle of each axle, from yaw rate and distance to the centre."""
    traverse = model.traverse
    half_base_m = rng.uniform(0.26, 0.36)
    sideways = np.abs(traverse.yaw_rate_rad_s[:, None] * (half_base_m * np.abs(FORE_AFT) + rng.uniform(0.1, 0.25)))
    forwards = np.abs(traverse.radius_m * traverse.wheel_speed_rad_s) + 0.004
    angle = np.arctan2(sideways, forwards)
    return _drag("turning-resistance", "yaw_rate", traverse.rotation * np.tanh(angle / rng.uniform(0.4, 1.2)))


def slip_sinkage(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Slip sinkage: the sinkage increases with slip by (1 + a·i)/(1 − a·i/2), and with it the torque."""
    traverse = model.traverse
    tables = {a: TorqueTable(model.ground, a) for a in np.linspace(0, 3.5, 6)}
    curve = np.array([t(traverse.load_N, traverse.slip) for t in tables.values()]) / model.gain_Nm_per_A
    at = np.array(list(tables))
    bend = rng.uniform(0.95, 1.05)

    def current(size: float) -> Array:
        above = np.clip(np.searchsorted(at, size), 1, len(at) - 1)
        part = (size - at[above - 1]) / (at[above] - at[above - 1])
        deeper = curve[above - 1] * (1 - part) + curve[above] * part - curve[0]
        return traverse.rotation * deeper * bend

    return ConcealedEffect("slip-sinkage", "slip-sinkage", "slip", current, largest=3.5)


def multi_pass(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Multi-pass compaction: the following axles need less torque; the leading axle depends on the direction."""
    traverse = model.traverse
    follows = rng.uniform(1.3, 1.8)
    rows = np.array([0.0, 0.0, 1.0, 1.0, follows, follows])
    passes = np.where(traverse.rotation >= 0, rows, rows[::-1])
    return _drag("multi-pass-compaction", "wheel_row", -model.current_A * passes)


def soil_transition(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Soil transition: cohesion and friction angle change over decimetres of ground, front wheels first."""
    traverse = model.traverse
    onset = rng.uniform(0.2, 0.8) * traverse.t_s[-1]
    travelled = np.concatenate(
        [[0.0], np.cumsum(np.abs(traverse.hub_speed_m_s.mean(axis=1))[1:] * np.diff(traverse.t_s))]
    )
    beyond_m = travelled - np.interp(onset, traverse.t_s, travelled)
    blend = 1 / (1 + np.exp(-(beyond_m[:, None] + 0.3 * FORE_AFT) / rng.uniform(0.05, 0.25)))
    weaker = rng.choice([-1.0, 1.0])
    which = rng.uniform(0.4, 1.0)

    def current(size: float) -> Array:
        cohesion = model.ground.cohesion_Pa * (1 + weaker * size * which)
        friction = model.ground.friction_angle_rad * (1 + weaker * size * (1 - which))
        other = TorqueTable(replace(model.ground, cohesion_Pa=cohesion, friction_angle_rad=friction))
        change = other(traverse.load_N, traverse.slip) / model.gain_Nm_per_A - np.abs(model.current_A)
        return traverse.rotation * blend * change

    largest = 0.85 if weaker < 0 else 1.5
    return ConcealedEffect("soil-transition", "soil-transition", "time", current, onset_s=onset, largest=largest)


def load_cell_drift(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Load-cell drift: one cell drifts by creep and a random walk; the motor carries the true load."""
    traverse = model.traverse
    wheel = int(rng.integers(1, 7))
    part = traverse.t_s / traverse.t_s[-1]
    walk = np.cumsum(rng.normal(size=len(part))) / np.sqrt(len(part))
    creep = (1 - np.exp(-part / rng.uniform(0.15, 0.5))) * rng.choice([-1.0, 1.0])
    smooth = np.convolve(np.pad(walk, 150, mode="edge"), np.hanning(301) / 150, mode="valid")[: len(part)]
    wanders = creep + rng.uniform(0, 0.5) * smooth
    drift = np.zeros((len(part), 6))
    drift[:, wheel - 1] = wanders / np.max(np.abs(wanders))

    def current(size: float) -> Array:
        read = model.torque(traverse.load_N + size * drift, traverse.slip)
        return traverse.rotation * (model.torque(traverse.load_N, traverse.slip) - read) / model.gain_Nm_per_A

    name = "load-cell-drift"
    return ConcealedEffect(name, name, "time", current, (wheel,), largest=35.0, added_load_N=lambda size: size * drift)


def current_bias(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Current-sensor bias: one current reading has an offset with a few percent of slow noise."""
    wheel = int(rng.integers(1, 7))
    step = model.traverse.t_s[1] - model.traverse.t_s[0]
    flicker = 1 + rng.uniform(0, 0.05) * autocorrelated_noise(rng, (len(model.traverse.t_s), 1), step, 60.0)
    sign = rng.choice([-1.0, 1.0])
    effect = _drag("current-sensor-bias", "none", sign * flicker * np.ones((1, 6)), (wheel,))
    return replace(effect, parameters=lambda size: {"offset": sign * size * float(flicker.mean())})


def bearing(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Bearing drag: one wheel's drag increases from an onset by a power of the time since."""
    traverse = model.traverse
    wheel = int(rng.integers(1, 7))
    onset = rng.uniform(0.2, 0.75) * traverse.t_s[-1]
    since = np.clip((traverse.t_s - onset) / (traverse.t_s[-1] - onset), 0, None)
    grown = since[:, None] ** rng.uniform(0.15, 0.6)
    return replace(_drag("bearing-drag", "time", traverse.rotation * grown, (wheel,)), onset_s=onset)


LIBRARY_EFFECTS: dict[str, Maker] = {
    "coulomb-friction": coulomb,
    "viscous-friction": viscous,
    "stribeck-friction": stribeck,
    "cold-lubricant-friction": cold_lubricant,
    "load-dependent-efficiency": load_dependent,
    "torque-constant-temperature": torque_constant,
    "rotor-inertia": rotor_inertia,
    "wheel-angle-ripple": ripple,
    "grade-resistance": grade,
    "turning-resistance": turning,
    "slip-sinkage": slip_sinkage,
    "multi-pass-compaction": multi_pass,
    "soil-transition": soil_transition,
    "load-cell-drift": load_cell_drift,
    "current-sensor-bias": current_bias,
    "bearing-drag": bearing,
}
"""The effects by name."""
