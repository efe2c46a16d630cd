"""The sixteen effects of the contract, each in a form of our own: other laws than a solver would be built on.

Friction fades by a rational law, grease follows Vogel's viscosity law, ripple has harmonics, a soil changes over
metres of ground, a bearing wears by a power of time, scrub follows the slip angle of each axle, a load cell takes a
random walk. A solver that names the physics must do so through the difference.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from regolithd.calibration.validation.blind_trials.drive import FORE_AFT, coloured
from regolithd.calibration.validation.blind_trials.ground import TorqueTable
from regolithd.calibration.validation.blind_trials.scene import EVERY_WHEEL, Concealed, Scene, on_wheels, some_wheels

Array = NDArray[np.float64]
Maker = Callable[[Generator, Scene], Concealed]


def _drag(name: str, covariate: str, shape: Array, wheels: tuple[int, ...] = EVERY_WHEEL) -> Concealed:
    """Return an effect whose current [A] is proportional to its size."""
    return Concealed(name, name, covariate, lambda size: size * shape * on_wheels(wheels), wheels)


def coulomb(rng: Generator, scene: Scene) -> Concealed:
    """Constant drag, a few percent different from wheel to wheel."""
    apart = 1 + rng.uniform(0, 0.1) * rng.normal(size=6)
    effect = _drag("coulomb-friction", "direction", scene.drive.rotation * apart, some_wheels(rng))
    at = [wheel - 1 for wheel in effect.wheels]
    return replace(effect, parameters=lambda size: {"coulomb_current": size * float(np.mean(apart[at]))})


def viscous(rng: Generator, scene: Scene) -> Concealed:
    """Drag growing with speed, by a power close to one."""
    speed = np.abs(scene.drive.wheel_speed_rad_s)
    power = rng.uniform(0.9, 1.1)
    return _drag("viscous-friction", "wheel_speed", scene.drive.rotation * speed**power, some_wheels(rng))


def stribeck(rng: Generator, scene: Scene) -> Concealed:
    """Extra drag near standstill, fading by a rational law."""
    fades_rad_s = rng.uniform(0.08, 0.16)
    ratio = np.abs(scene.drive.wheel_speed_rad_s) / fades_rad_s
    return _drag("stribeck-friction", "wheel_speed", scene.drive.rotation / (1 + ratio ** rng.uniform(2, 3)))


def cold_lubricant(rng: Generator, scene: Scene) -> Concealed:
    """Drag following a grease's viscosity (Vogel's law), less what is left of it when warm."""
    celsius = np.clip(scene.drive.temperature_degC, -40, 60)
    steep, pole = rng.uniform(500, 900), rng.uniform(-120, -95)

    def viscosity(at: Array | float) -> Array:
        return np.asarray(np.exp(steep / (np.asarray(at) - pole) - steep / (-20 - pole)), np.float64)

    extra = viscosity(celsius) - viscosity(45.0)
    return _drag("cold-lubricant-friction", "temperature", scene.drive.rotation * extra)


def load_dependent(rng: Generator, scene: Scene) -> Concealed:
    """Tooth friction: losses growing faster than the torque carried."""
    current = scene.current_A
    relative = np.abs(current) / scene.mean_current_A
    shape = np.sign(current) * relative ** rng.uniform(1.8, 2.4) * scene.mean_current_A
    return _drag("load-dependent-efficiency", "torque", shape)


def torque_constant(rng: Generator, scene: Scene) -> Concealed:
    """Weaken the magnet as the motor warms from 20 °C, a little more or less than linearly."""
    warmer = scene.drive.temperature_degC - 20
    curve = rng.uniform(-0.002, 0.002)

    def current(size: float) -> Array:
        weakened = 1 - size * warmer * (1 + curve * warmer)
        return scene.current_A * (1 / np.clip(weakened, 0.4, 2.5) - 1)

    name = "torque-constant-temperature"
    return Concealed(name, name, "temperature", current, largest=0.02)


def rotor_inertia(rng: Generator, scene: Scene) -> Concealed:
    """Charge current for accelerating rotor and wheel; the drive's stiffness delays it by a fraction of a second."""
    drive = scene.drive
    step = drive.t_s[1] - drive.t_s[0]
    acceleration = np.gradient(drive.wheel_speed_rad_s, drive.t_s, axis=0)
    lag = np.exp(-np.arange(6) * step / rng.uniform(0.08, 0.25))
    late = np.apply_along_axis(lambda row: np.convolve(row, lag / lag.sum())[: len(row)], 0, acceleration)
    return _drag("rotor-inertia", "wheel_acceleration", late)


def ripple(rng: Generator, scene: Scene) -> Concealed:
    """Grousers or a gear: periodic in the wheel's angle, with an overtone, each wheel in its own phase."""
    order = int(rng.integers(3, 20))
    phase, overtone = rng.uniform(0, 2 * np.pi, 6), rng.uniform(0, 0.35)
    angle = order * scene.drive.wheel_angle_rad + phase
    shape = np.abs(scene.drive.rotation) * (np.sin(angle) + overtone * np.sin(2 * angle + rng.uniform(0, 6)))
    effect = _drag("wheel-angle-ripple", "wheel_angle", shape)
    return replace(effect, parameters=lambda _: {"order": float(order)})


def grade(rng: Generator, scene: Scene) -> Concealed:
    """Weight along the slope, carried by the wheels as they are loaded; brakes hold it at standstill."""
    drive = scene.drive
    share = drive.load_N / drive.load_N.mean() if rng.uniform() < 0.5 else np.ones((1, 6))
    uphill = np.sin(drive.pitch_rad)[:, None] * share * np.abs(drive.rotation)
    return _drag("grade-resistance", "pitch", uphill)


def turning(rng: Generator, scene: Scene) -> Concealed:
    """Scrub by slip angle: each axle is dragged sideways by the yaw rate times its distance from the centre."""
    drive = scene.drive
    half_base_m = rng.uniform(0.26, 0.36)
    sideways = np.abs(drive.yaw_rate_rad_s[:, None] * (half_base_m * np.abs(FORE_AFT) + rng.uniform(0.1, 0.25)))
    forwards = np.abs(drive.radius_m * drive.wheel_speed_rad_s) + 0.004
    angle = np.arctan2(sideways, forwards)
    return _drag("turning-resistance", "yaw_rate", drive.rotation * np.tanh(angle / rng.uniform(0.4, 1.2)))


def slip_sinkage(rng: Generator, scene: Scene) -> Concealed:
    """Sinkage that grows with slip, (1 + a·i)/(1 − a·i/2): the wheel digs, and works harder for it."""
    drive = scene.drive
    tables = {a: TorqueTable(scene.ground, a) for a in np.linspace(0, 3.5, 6)}
    curve = np.array([t(drive.load_N, drive.slip) for t in tables.values()]) / scene.gain_Nm_per_A
    at = np.array(list(tables))
    bend = rng.uniform(0.95, 1.05)

    def current(size: float) -> Array:
        above = np.clip(np.searchsorted(at, size), 1, len(at) - 1)
        part = (size - at[above - 1]) / (at[above] - at[above - 1])
        deeper = curve[above - 1] * (1 - part) + curve[above] * part - curve[0]
        return drive.rotation * deeper * bend

    return Concealed("slip-sinkage", "slip-sinkage", "slip", current, largest=3.5)


def multi_pass(rng: Generator, scene: Scene) -> Concealed:
    """Let the second and third wheel find the soil pressed; which one leads depends on the way the rover goes."""
    drive = scene.drive
    follows = rng.uniform(1.3, 1.8)
    rows = np.array([0.0, 0.0, 1.0, 1.0, follows, follows])
    passes = np.where(drive.rotation >= 0, rows, rows[::-1])
    return _drag("multi-pass-compaction", "wheel_row", -scene.current_A * passes)


def soil_transition(rng: Generator, scene: Scene) -> Concealed:
    """Change cohesion and friction from some place on, over decimetres of ground; front wheels get there first."""
    drive = scene.drive
    onset = rng.uniform(0.2, 0.8) * drive.t_s[-1]
    travelled = np.concatenate([[0.0], np.cumsum(np.abs(drive.hub_speed_m_s.mean(axis=1))[1:] * np.diff(drive.t_s))])
    beyond_m = travelled - np.interp(onset, drive.t_s, travelled)
    blend = 1 / (1 + np.exp(-(beyond_m[:, None] + 0.3 * FORE_AFT) / rng.uniform(0.05, 0.25)))
    weaker = rng.choice([-1.0, 1.0])
    which = rng.uniform(0.4, 1.0)

    def current(size: float) -> Array:
        cohesion = scene.ground.cohesion_Pa * (1 + weaker * size * which)
        friction = scene.ground.friction_angle_rad * (1 + weaker * size * (1 - which))
        other = TorqueTable(replace(scene.ground, cohesion_Pa=cohesion, friction_angle_rad=friction))
        change = other(drive.load_N, drive.slip) / scene.gain_Nm_per_A - np.abs(scene.current_A)
        return drive.rotation * blend * change

    largest = 0.85 if weaker < 0 else 1.5
    return Concealed("soil-transition", "soil-transition", "time", current, onset_s=onset, largest=largest)


def load_cell_drift(rng: Generator, scene: Scene) -> Concealed:
    """One cell wanders: a slow random walk, or a creep that settles; the motor feels the true load all the while."""
    drive = scene.drive
    wheel = int(rng.integers(1, 7))
    part = drive.t_s / drive.t_s[-1]
    walk = np.cumsum(rng.normal(size=len(part))) / np.sqrt(len(part))
    creep = (1 - np.exp(-part / rng.uniform(0.15, 0.5))) * rng.choice([-1.0, 1.0])
    smooth = np.convolve(np.pad(walk, 150, mode="edge"), np.hanning(301) / 150, mode="valid")[: len(part)]
    wanders = creep + rng.uniform(0, 0.5) * smooth
    drift = np.zeros((len(part), 6))
    drift[:, wheel - 1] = wanders / np.max(np.abs(wanders))

    def current(size: float) -> Array:
        read = scene.torque(drive.load_N + size * drift, drive.slip)
        return drive.rotation * (scene.torque(drive.load_N, drive.slip) - read) / scene.gain_Nm_per_A

    name = "load-cell-drift"
    return Concealed(name, name, "time", current, (wheel,), largest=35.0, added_load_N=lambda size: size * drift)


def current_bias(rng: Generator, scene: Scene) -> Concealed:
    """One current reading is offset, turning or not, with a little flicker of its own."""
    wheel = int(rng.integers(1, 7))
    step = scene.drive.t_s[1] - scene.drive.t_s[0]
    flicker = 1 + rng.uniform(0, 0.05) * coloured(rng, (len(scene.drive.t_s), 1), step, 60.0)
    sign = rng.choice([-1.0, 1.0])
    effect = _drag("current-sensor-bias", "none", sign * flicker * np.ones((1, 6)), (wheel,))
    return replace(effect, parameters=lambda size: {"offset": sign * size * float(flicker.mean())})


def bearing(rng: Generator, scene: Scene) -> Concealed:
    """One wheel's drag grows from some time on, by a power of the time since."""
    drive = scene.drive
    wheel = int(rng.integers(1, 7))
    onset = rng.uniform(0.2, 0.75) * drive.t_s[-1]
    since = np.clip((drive.t_s - onset) / (drive.t_s[-1] - onset), 0, None)
    grown = since[:, None] ** rng.uniform(0.15, 0.6)
    return replace(_drag("bearing-drag", "time", drive.rotation * grown, (wheel,)), onset_s=onset)


EFFECTS: dict[str, Maker] = {
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
"""How each named effect is made."""
