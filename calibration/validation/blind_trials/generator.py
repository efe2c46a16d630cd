"""Recordings with an effect concealed, and the truth that belongs in the envelope.

One seed and one number make one trial: a drive, a ground whose base parameters lie within the stated priors, none, one
or two effects at 5–25 % of the mean current, sensors that err as the simulation's `[sensors]` table says, and
autocorrelated noise of about 30 % of the mean current.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.validation.blind_trials.concealed import EFFECTS
from regolithd.calibration.validation.blind_trials.drive import (
    EVERYTHING,
    KINDS,
    Drive,
    coloured,
    lasting_s,
    make_drive,
    moves_of,
)
from regolithd.calibration.validation.blind_trials.ground import Ground, TorqueTable
from regolithd.calibration.validation.blind_trials.out_of_library import OUTSIDE
from regolithd.calibration.validation.blind_trials.scene import Concealed, Scene, of_strength

if TYPE_CHECKING:
    from numpy.random import Generator

Array = NDArray[np.float64]
Tables = dict[str, dict[str, float | str]]

SOILS = (
    ("lete-sand", (1220, 30.3, 0.0116, 0.79, 102.0, 5301.0)),
    ("sandy-loam", (3150, 30.0, 0.0420, 0.66, 6.9, 752.0)),
    ("clayey-soil", (4120, 11.8, 0.0254, 0.50, 13.19, 692.15)),
    ("medium-soil", (6410, 25.7, 0.0238, 0.80, 29.76, 2083.0)),
)
"""The paper's Table 1 with Wong's constants: c (Pa), φ (°), K (m), n, k_c, k_φ."""

SHARES = {"nothing": 0.2, "single": 0.4, "pair": 0.15, "outside": 0.15, "constant": 0.1}
"""What a batch is made of. The rows of the score tell how many there were of each."""

FLOOR_A = 1e-4
"""Least count of the current reading: the controller reports whole tenths of a milliampere."""


@dataclass(frozen=True)
class Plan:
    """What a trial will conceal, before anything is drawn: so that every name has its turn."""

    number: int
    seed: int
    group: str
    names: tuple[str, ...]


@dataclass(frozen=True)
class Trial:
    """One recording as its sensors give it, the simulation that is claimed, and what is concealed.

    Wheels in (n, 6), the body in (n,). `true_rmse_A` is what the true model leaves over, fed with the recorded inputs.
    """

    plan: Plan
    drive: Drive
    tables: Tables
    current_A: Array
    load_N: Array
    ground_speed_m_s: Array
    pitch_rad: Array
    roll_rad: Array
    yaw_rate_rad_s: Array
    temperature_degC: Array
    effects: tuple[Concealed, ...]
    mean_current_A: float
    noise_A: float
    true_rmse_A: float


def plan_batch(seed: int, count: int) -> list[Plan]:
    """Return the plans of a batch: groups in their shares, names in turn, the order shuffled by the seed."""
    rng = np.random.default_rng([seed, 0])
    groups = [group for group, share in SHARES.items() for _ in range(round(share * count))][:count]
    groups += ["single"] * (count - len(groups))
    turn = dict.fromkeys(SHARES, 0)
    names, outside = list(rng.permutation(list(EFFECTS))), list(rng.permutation(list(OUTSIDE)))
    plans = []
    for number, group in enumerate(rng.permutation(groups)):
        at = turn[str(group)]
        turn[str(group)] += 1
        chosen = {
            "nothing": [],
            "single": [names[at % len(names)]],
            "pair": [names[at % len(names)], names[(at + 1 + (at // len(names) + 3 * at) % 14) % len(names)]],
            "outside": [outside[at % len(outside)]],
            "constant": [("coulomb-friction", "viscous-friction")[at % 2]],
        }[str(group)]
        plans.append(Plan(number, seed, str(group), tuple(str(name) for name in chosen)))
    return plans


def simulation_tables(rng: Generator) -> Tables:
    """Return the tables of the simulation that is claimed, with priors about as wide as the samples'."""
    _, (cohesion, friction, modulus, exponent, k_c, k_phi) = SOILS[rng.integers(len(SOILS))]
    return {
        "simulation": {"model": "rover-wheel", "slip_without_ground_speed": 0.025},
        "drivetrain": {
            "torque_constant_Nm_per_A": 0.0234,
            "planetary_ratio": 14.0,
            "planetary_efficiency": 0.7,
            "harmonic_ratio": 100.0,
            "harmonic_efficiency": 0.7,
            "gain_relative_std": float(rng.choice([0.015, 0.02, 0.02, 0.025])),
        },
        "wheel": {"radius_m": 0.075, "width_m": 0.07},
        "rover": {"mass_kg": 30.0, "wheelbase_m": 0.65, "track_m": 0.55},
        "soil": {
            "cohesion_Pa": cohesion,
            "friction_angle_deg": friction,
            "shear_modulus_m": modulus,
            "sinkage_exponent": exponent,
            "k_c_kN": k_c,
            "k_phi_kN": k_phi,
            "cohesion_relative_std": float(rng.choice([0.02, 0.03, 0.03, 0.04])),
            "friction_angle_relative_std": 0.02,
        },
        "sensors": {
            "load_relative_std": 0.02,
            "ground_speed_relative_std": 0.004,
            "pitch_std_rad": 0.005,
            "roll_std_rad": 0.005,
            "yaw_rate_std_rad_s": 0.001,
            "temperature_std_degC": 0.5,
        },
    }


def _number(tables: Tables, table: str, key: str) -> float:
    return float(tables[table][key])


def true_scene(rng: Generator, tables: Tables, drive: Drive) -> Scene:
    """Return the drive on the true ground: base parameters drawn within the priors that the tables state."""

    def drawn(table: str, key: str, std: str) -> float:
        return _number(tables, table, key) * (1 + _number(tables, table, std) * float(np.clip(rng.normal(), -2, 2)))

    width = _number(tables, "wheel", "width_m")
    ground = Ground(
        cohesion_Pa=drawn("soil", "cohesion_Pa", "cohesion_relative_std"),
        friction_angle_rad=np.radians(drawn("soil", "friction_angle_deg", "friction_angle_relative_std")),
        shear_modulus_m=_number(tables, "soil", "shear_modulus_m"),
        stiffness=1000 * (_number(tables, "soil", "k_c_kN") / width + _number(tables, "soil", "k_phi_kN")),
        exponent=_number(tables, "soil", "sinkage_exponent"),
        radius_m=_number(tables, "wheel", "radius_m"),
        width_m=width,
    )
    gears = _number(tables, "drivetrain", "planetary_ratio") * _number(tables, "drivetrain", "harmonic_ratio")
    loss = _number(tables, "drivetrain", "planetary_efficiency") * _number(tables, "drivetrain", "harmonic_efficiency")
    gain = drawn("drivetrain", "torque_constant_Nm_per_A", "gain_relative_std") * gears * loss
    return Scene(drive, ground, TorqueTable(ground), gain)


def conceal(rng: Generator, plan: Plan, scene: Scene) -> tuple[Concealed, ...]:
    """Return the plan's effects, each of a strength between 5 and 25 % of the mean current."""
    strengths = [rng.uniform(0.05, 0.25) for _ in plan.names]
    made = (concealed_in(plan, scene, index) for index in range(len(plan.names)))
    return tuple(of_strength(scene, effect, strength) for effect, strength in zip(made, strengths, strict=True))


def concealed_in(plan: Plan, scene: Scene, index: int) -> Concealed:
    """Return one of the plan's effects in a scene, of no size yet: its law is the same in every scene."""
    makers = {**EFFECTS, **OUTSIDE}
    return makers[plan.names[index]](np.random.default_rng([plan.seed, 2, plan.number, index]), scene)


def motor_effects(effects: tuple[Concealed, ...], drive: Drive) -> Array:
    """Return what the effects add to the motors' true current [A]; a load cell's error adds nothing to it, (n, 6)."""
    at_motor = (effect.added_current_A(effect.size) for effect in effects if effect.added_load_N is None)
    return np.asarray(sum(at_motor, np.zeros(drive.load_N.shape)), np.float64)


def make_trial(plan: Plan, *, duration_s: float = 1800.0, step_s: float = 0.2, experiment: str = "") -> Trial:
    """Return the trial of this plan: the same for the same plan, always.

    With an experiment in words, the same rover with the same effects drives again: it moves what the words ask for,
    and for as long, if that is longer.
    """
    rng = np.random.default_rng([plan.seed, 1, plan.number])
    tables = simulation_tables(rng)
    kind = "constant" if plan.group == "constant" else str(rng.choice(["patrol", "patrol", "patrol", *KINDS]))
    drive = _driven(rng, kind, tables, duration_s, step_s)
    scene = true_scene(rng, tables, drive)
    effects = conceal(rng, plan, scene)
    if experiment:
        rng = np.random.default_rng([plan.seed, 3, plan.number])
        duration_s = max(duration_s, lasting_s(experiment))
        drive = _driven(rng, "experiment", tables, duration_s, step_s, moves_of(experiment))
        scene = replace(scene, drive=drive)
        again = (concealed_in(plan, scene, index) for index in range(len(effects)))
        effects = tuple(replace(now, size=before.size) for now, before in zip(again, effects, strict=True))
    return _recorded(rng, plan, scene, tables, effects)


def _driven(  # what a drive is made of
    rng: Generator, kind: str, tables: Tables, duration_s: float, step_s: float, moves: frozenset[str] = EVERYTHING
) -> Drive:
    """Return a drive of the rover that the tables describe."""
    return make_drive(
        rng,
        kind,
        duration_s=duration_s,
        step_s=step_s,
        radius_m=_number(tables, "wheel", "radius_m"),
        track_m=_number(tables, "rover", "track_m"),
        mass_kg=_number(tables, "rover", "mass_kg"),
        moves=moves,
    )


def _recorded(rng: Generator, plan: Plan, scene: Scene, tables: Tables, effects: tuple[Concealed, ...]) -> Trial:
    """Return the trial with the motors' noise on it, as its sensors report it."""
    drive = scene.drive
    step_s = float(drive.t_s[1] - drive.t_s[0])
    added = motor_effects(effects, drive)
    noise_A = rng.uniform(0.27, 0.32) * scene.mean_current_A
    slow = rng.uniform(0.3, 0.55)
    correlation_s = float(np.exp(rng.uniform(np.log(1.0), np.log(15.0))))
    shape = drive.load_N.shape
    noise = np.sqrt(slow) * coloured(rng, shape, step_s, correlation_s) + np.sqrt(1 - slow) * rng.normal(size=shape)
    current = np.round((scene.current_A + added + noise_A * noise) / FLOOR_A) * FLOOR_A
    return _sensed(rng, plan=plan, scene=scene, tables=tables, effects=effects, current=current, noise=noise_A)


def _sensed(
    rng: Generator,
    *,
    plan: Plan,
    scene: Scene,
    tables: Tables,
    effects: tuple[Concealed, ...],
    current: Array,
    noise: float,
) -> Trial:
    """Return the trial as its sensors report it, each with the error that `[sensors]` states."""
    drive, shape = scene.drive, scene.drive.load_N.shape
    error = {key: float(value) for key, value in tables["sensors"].items()}
    cells = sum((e.added_load_N(e.size) for e in effects if e.added_load_N), np.zeros(shape))
    load = (drive.load_N + cells) * (1 + error["load_relative_std"] * rng.normal(size=shape))
    speed = drive.hub_speed_m_s * (1 + error["ground_speed_relative_std"] * rng.normal(size=shape))
    with np.errstate(divide="ignore", invalid="ignore"):
        slip = np.where(drive.moving, 1 - speed / (drive.radius_m * drive.wheel_speed_rad_s), drive.slip)
    modelled = drive.rotation * scene.torque(load - cells, slip) / scene.gain_Nm_per_A + motor_effects(effects, drive)
    body = len(drive.t_s)
    return Trial(
        plan=plan,
        drive=drive,
        tables=tables,
        current_A=current,
        load_N=load,
        ground_speed_m_s=speed,
        pitch_rad=drive.pitch_rad + error["pitch_std_rad"] * rng.normal(size=body),
        roll_rad=drive.roll_rad + error["roll_std_rad"] * rng.normal(size=body),
        yaw_rate_rad_s=drive.yaw_rate_rad_s + error["yaw_rate_std_rad_s"] * rng.normal(size=body),
        temperature_degC=drive.temperature_degC + error["temperature_std_degC"] * rng.normal(size=shape),
        effects=effects,
        mean_current_A=scene.mean_current_A,
        noise_A=noise,
        true_rmse_A=float(np.sqrt(np.mean((current - modelled)[drive.moving] ** 2))),
    )
