"""Generates the recordings of a batch, with their truth.

Seed and number determine a trial: a traverse, a ground whose base parameters are drawn from the priors in SIM.toml,
none, one or two effects of 5–25 % of the mean current, sensor errors as in SIM.toml's `[sensors]`, and autocorrelated
noise of about 30 % of the mean current.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.validation.blind_trials.recordings.concealed_effect import (
    ConcealedEffect,
    TrueModel,
    of_strength,
)
from regolithd.calibration.validation.blind_trials.recordings.ground import Ground, TorqueTable
from regolithd.calibration.validation.blind_trials.recordings.library_effects import LIBRARY_EFFECTS
from regolithd.calibration.validation.blind_trials.recordings.out_of_library import OUT_OF_LIBRARY
from regolithd.calibration.validation.blind_trials.recordings.traverse import (
    ALL_CONDITIONS,
    KINDS,
    ProposedExperiment,
    Traverse,
    autocorrelated_noise,
    make_traverse,
)

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
"""The paper's Table 1 with Wong's constants: c [Pa], φ [°], K [m], n, k_c [kN/m^(n+1)], k_φ [kN/m^(n+2)]."""

SHARES = {"nothing": 0.2, "single": 0.4, "pair": 0.15, "outside": 0.15, "constant": 0.1}
"""Share of each group in a batch; `outside` are effects out of the library."""

RESOLUTION_A = 1e-4
"""Resolution of the current reading [A]."""


@dataclass(frozen=True)
class Plan:
    """What a trial conceals: fixed for the whole batch, so that every effect occurs."""

    number: int
    seed: int
    group: str
    names: tuple[str, ...]


@dataclass(frozen=True)
class Trial:
    """One recording as measured, the tables of SIM.toml, and the concealed effects.

    Wheels in (n, 6), the body in (n,). `true_rmse_A` is the RMSE of the true model with the recorded inputs.
    """

    plan: Plan
    traverse: Traverse
    tables: Tables
    current_A: Array
    load_N: Array
    ground_speed_m_s: Array
    pitch_rad: Array
    roll_rad: Array
    yaw_rate_rad_s: Array
    temperature_degC: Array
    effects: tuple[ConcealedEffect, ...]
    mean_current_A: float
    noise_A: float
    true_rmse_A: float


def plan_batch(seed: int, count: int) -> list[Plan]:
    """Return the plans of a batch: groups in their shares, effects in rotation, in random order."""
    rng = np.random.default_rng([seed, 0])
    groups = [group for group, share in SHARES.items() for _ in range(round(share * count))][:count]
    groups += ["single"] * (count - len(groups))
    turn = dict.fromkeys(SHARES, 0)
    names, others = list(rng.permutation(list(LIBRARY_EFFECTS))), list(rng.permutation(list(OUT_OF_LIBRARY)))
    plans = []
    for number, group in enumerate(rng.permutation(groups)):
        at = turn[str(group)]
        turn[str(group)] += 1
        chosen = {
            "nothing": [],
            "single": [names[at % len(names)]],
            "pair": [names[at % len(names)], names[(at + 1 + (at // len(names) + 3 * at) % 14) % len(names)]],
            "outside": [others[at % len(others)]],
            "constant": [("coulomb-friction", "viscous-friction")[at % 2]],
        }[str(group)]
        plans.append(Plan(number, seed, str(group), tuple(str(name) for name in chosen)))
    return plans


def simulation_tables(rng: Generator) -> Tables:
    """Return the tables of SIM.toml: the base simulation with the standard deviations of its parameters."""
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


def true_model(rng: Generator, tables: Tables, traverse: Traverse) -> TrueModel:
    """Return the true base model: parameters drawn from the priors in the tables, clipped to two std."""

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
    return TrueModel(traverse, ground, TorqueTable(ground), gain)


def conceal(rng: Generator, plan: Plan, model: TrueModel) -> tuple[ConcealedEffect, ...]:
    """Return the plan's effects, each with a strength of 5 to 25 % of the mean current."""
    strengths = [rng.uniform(0.05, 0.25) for _ in plan.names]
    made = (effect_of_plan(plan, model, index) for index in range(len(plan.names)))
    return tuple(of_strength(model, effect, strength) for effect, strength in zip(made, strengths, strict=True))


def effect_of_plan(plan: Plan, model: TrueModel, index: int) -> ConcealedEffect:
    """Return one of the plan's effects, without a size; its law is the same for every traverse."""
    makers = {**LIBRARY_EFFECTS, **OUT_OF_LIBRARY}
    return makers[plan.names[index]](np.random.default_rng([plan.seed, 2, plan.number, index]), model)


def motor_effects(effects: tuple[ConcealedEffect, ...], traverse: Traverse) -> Array:
    """Return the current that the effects add at the motors [A], (n, 6); an error of a load cell adds none."""
    at_motor = (effect.added_current_A(effect.size) for effect in effects if effect.added_load_N is None)
    return np.asarray(sum(at_motor, np.zeros(traverse.load_N.shape)), np.float64)


def make_trial(
    plan: Plan, *, duration_s: float = 1800.0, step_s: float = 0.2, experiment: ProposedExperiment | None = None
) -> Trial:
    """Return the trial of a plan; the same plan always gives the same trial.

    With an experiment, the same rover with the same effects drives again: it varies the conditions that are asked for,
    and drives for as long, if that is longer than `duration_s`.
    """
    rng = np.random.default_rng([plan.seed, 1, plan.number])
    tables = simulation_tables(rng)
    kind = "constant" if plan.group == "constant" else str(rng.choice(["patrol", "patrol", "patrol", *KINDS]))
    traverse = rover_traverse(rng, kind, tables, duration_s, step_s)
    model = true_model(rng, tables, traverse)
    effects = conceal(rng, plan, model)
    if experiment:
        rng = np.random.default_rng([plan.seed, 3, plan.number])
        duration_s = max(duration_s, experiment.duration_s)
        traverse = rover_traverse(rng, "experiment", tables, duration_s, step_s, experiment.conditions)
        model = replace(model, traverse=traverse)
        repeated = (effect_of_plan(plan, model, index) for index in range(len(effects)))
        effects = tuple(replace(now, size=before.size) for now, before in zip(repeated, effects, strict=True))
    return with_noise(rng, plan, model, tables, effects)


def rover_traverse(  # the quantities of a traverse
    rng: Generator, kind: str, tables: Tables, duration_s: float, step_s: float, varied: frozenset[str] = ALL_CONDITIONS
) -> Traverse:
    """Return a traverse of the rover of SIM.toml."""
    return make_traverse(
        rng,
        kind,
        duration_s=duration_s,
        step_s=step_s,
        radius_m=_number(tables, "wheel", "radius_m"),
        track_m=_number(tables, "rover", "track_m"),
        mass_kg=_number(tables, "rover", "mass_kg"),
        varied=varied,
    )


def with_noise(
    rng: Generator, plan: Plan, model: TrueModel, tables: Tables, effects: tuple[ConcealedEffect, ...]
) -> Trial:
    """Return the trial with noise on the motor currents, as measured."""
    traverse = model.traverse
    step_s = float(traverse.t_s[1] - traverse.t_s[0])
    added = motor_effects(effects, traverse)
    noise_A = rng.uniform(0.27, 0.32) * model.mean_current_A
    slow = rng.uniform(0.3, 0.55)
    correlation_s = float(np.exp(rng.uniform(np.log(1.0), np.log(15.0))))
    shape = traverse.load_N.shape
    noise = np.sqrt(slow) * autocorrelated_noise(rng, shape, step_s, correlation_s) + np.sqrt(1 - slow) * rng.normal(
        size=shape
    )
    current = np.round((model.current_A + added + noise_A * noise) / RESOLUTION_A) * RESOLUTION_A
    return _as_measured(rng, plan=plan, model=model, tables=tables, effects=effects, current=current, noise=noise_A)


def _as_measured(
    rng: Generator,
    *,
    plan: Plan,
    model: TrueModel,
    tables: Tables,
    effects: tuple[ConcealedEffect, ...],
    current: Array,
    noise: float,
) -> Trial:
    """Return the trial as measured: each sensor with the error in SIM.toml's `[sensors]`."""
    traverse, shape = model.traverse, model.traverse.load_N.shape
    error = {key: float(value) for key, value in tables["sensors"].items()}
    cells = sum((e.added_load_N(e.size) for e in effects if e.added_load_N), np.zeros(shape))
    load = (traverse.load_N + cells) * (1 + error["load_relative_std"] * rng.normal(size=shape))
    speed = traverse.hub_speed_m_s * (1 + error["ground_speed_relative_std"] * rng.normal(size=shape))
    with np.errstate(divide="ignore", invalid="ignore"):
        slip = np.where(traverse.moving, 1 - speed / (traverse.radius_m * traverse.wheel_speed_rad_s), traverse.slip)
    modelled = traverse.rotation * model.torque(load - cells, slip) / model.gain_Nm_per_A + motor_effects(
        effects, traverse
    )
    body = len(traverse.t_s)
    return Trial(
        plan=plan,
        traverse=traverse,
        tables=tables,
        current_A=current,
        load_N=load,
        ground_speed_m_s=speed,
        pitch_rad=traverse.pitch_rad + error["pitch_std_rad"] * rng.normal(size=body),
        roll_rad=traverse.roll_rad + error["roll_std_rad"] * rng.normal(size=body),
        yaw_rate_rad_s=traverse.yaw_rate_rad_s + error["yaw_rate_std_rad_s"] * rng.normal(size=body),
        temperature_degC=traverse.temperature_degC + error["temperature_std_degC"] * rng.normal(size=shape),
        effects=effects,
        mean_current_A=model.mean_current_A,
        noise_A=noise,
        true_rmse_A=float(np.sqrt(np.mean((current - modelled)[traverse.moving] ** 2))),
    )
