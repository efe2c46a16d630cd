"""What is driven in the study: the blind trials' rover, and the automated guided vehicle of the other machines.

Each first drives at one speed on level ground, then what an experiment varies, with the same concealed effect of the
same size. Nothing here knows the solver.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.validation.blind_trials.recordings.files import write_trial
from regolithd.calibration.validation.blind_trials.recordings.generator import Plan, make_trial
from regolithd.calibration.validation.blind_trials.recordings.traverse import CONDITIONS_OF, ProposedExperiment
from regolithd.calibration.validation.machine_trials.cases.files import write_recording, write_simulation
from regolithd.calibration.validation.machine_trials.cases.generator import made, record, true_values
from regolithd.calibration.validation.machine_trials.cases.plan import plan_case
from regolithd.calibration.validation.machine_trials.cases.strength import of_strength
from regolithd.calibration.validation.machine_trials.machines import agv_drive
from regolithd.calibration.validation.machine_trials.machines.agv_drive import AGV_DRIVE
from regolithd.calibration.validation.machine_trials.physics.machine import Drive, Schedule, World

if TYPE_CHECKING:
    from numpy.random import Generator

LENGTH_S, STEP_S = 1200.0, 0.5
"""Length of each recording and its step: a third of the usual evidence, so that an experiment matters (a choice)."""
USUAL_RAD_S, FASTEST_RAD_S = (2.5, 5.0), 8.0
"""Speeds of the vehicle at one speed, and the highest in an experiment."""
LEG_S = (20.0, 60.0)
WARMING_K = 8.0
"""How much the vehicle's motors warm up in the first drive."""
Write = Callable[[Plan, ProposedExperiment | None, Path, float], None]


@dataclass(frozen=True)
class Subject:
    """A machine of the study.

    Attributes
    ----------
    name: on the command line and in the figures
    write: write recording.csv.gz and SIM.toml of a plan, of the first drive or of an experiment, of such a length [s]
    varied: the covariates that an experiment can vary
    can_lift: whether a part of it can be without load
    steady: the covariates that stay constant where an experiment does not vary them, but for the sensors' noise
    """

    name: str
    write: Write
    varied: tuple[str, ...]
    can_lift: bool
    steady: frozenset[str] = frozenset()


def write_rover(plan: Plan, experiment: ProposedExperiment | None, folder: Path, length_s: float) -> None:
    """Write the files of the rover."""
    driven = replace(experiment, duration_s=length_s) if experiment else None
    write_trial(make_trial(plan, duration_s=length_s, step_s=STEP_S, experiment=driven), folder)


def write_vehicle(plan: Plan, experiment: ProposedExperiment | None, folder: Path, length_s: float) -> None:
    """Write the files of the vehicle."""
    rng = np.random.default_rng([plan.seed, 11, plan.number])
    schedule = Schedule(1 / STEP_S, length_s)
    first = World(AGV_DRIVE, level_drive(rng, schedule), true_values(rng, AGV_DRIVE, off=False))
    (name,) = plan.names
    maker, seed = {**AGV_DRIVE.effects, **AGV_DRIVE.rivals}[name], int(rng.integers(2**32))
    effect = of_strength(first, made(maker, seed, first), rng.uniform(0.1, 0.25))
    world = first
    if experiment:
        again = np.random.default_rng([plan.seed, 12, plan.number])
        world = replace(first, drive=varied_drive(again, schedule, first.drive, experiment.vary))
        effect = replace(made(maker, seed, world), size=effect.size)
        rng = again
    case = plan_case(0, plan.seed, AGV_DRIVE.name, "single", 0)
    write_simulation(AGV_DRIVE, AGV_DRIVE.base_units, folder)
    recorded = record(rng, case, world, (effect,), ())
    write_recording(recorded, AGV_DRIVE.base_units, folder / "recording.csv.gz")


def level_drive(rng: Generator, schedule: Schedule) -> Drive:
    """Return a drive of the vehicle at one speed and payload, straight on a level floor, while its motors warm up."""
    usual = agv_drive.drive(rng, schedule)
    one = np.ones(usual.compared.shape)
    speed = rng.uniform(*USUAL_RAD_S) * one
    warming = np.linspace(0, WARMING_K, len(one))[:, None]
    columns = {
        **usual.columns,
        agv_drive.SPEED: speed,
        agv_drive.ACCELERATION: 0 * one,
        agv_drive.ANGLE: np.cumsum(speed, axis=0) * usual.step_s,
        agv_drive.PAYLOAD: rng.uniform(40, 100) * one,
        agv_drive.PITCH: 0 * one,
        agv_drive.YAW_RATE: 0 * one,
        agv_drive.TEMPERATURE: rng.uniform(5, 20) + warming * one,
    }
    return Drive(usual.t_s, columns, one > 0)


def varied_drive(rng: Generator, schedule: Schedule, level: Drive, vary: frozenset[str]) -> Drive:
    """Return a drive that varies these covariates alone; the others are those of the level drive."""
    free = agv_drive.drive(rng, schedule).columns
    columns = dict(level.columns)
    for covariate, column in {
        "torque": agv_drive.PAYLOAD,
        "load": agv_drive.PAYLOAD,
        "pitch": agv_drive.PITCH,
        "yaw_rate": agv_drive.YAW_RATE,
        "temperature": agv_drive.TEMPERATURE,
    }.items():
        if covariate in vary:
            columns[column] = free[column]
    usual = float(level.columns[agv_drive.SPEED][0, 0])
    speed = legs(rng, level.t_s, usual, vary)[:, None] * np.ones(2)
    if "yaw_rate" in vary:
        speed = speed + columns[agv_drive.YAW_RATE] * agv_drive.SIDE * agv_drive.TRACK_M / 2 / agv_drive.RADIUS_M
    columns[agv_drive.SPEED] = speed
    columns[agv_drive.ACCELERATION] = np.gradient(speed, level.t_s, axis=0)
    columns[agv_drive.ANGLE] = np.cumsum(speed, axis=0) * level.step_s
    return Drive(level.t_s, columns, np.abs(speed) > agv_drive.STANDING_RAD_S)


def legs(rng: Generator, t_s: np.ndarray, usual: float, vary: frozenset[str]) -> np.ndarray:
    """Return the speed of the middle [rad/s], shape (time,): legs of constant speed with ramps between them."""
    at, times, speeds = 0.0, [0.0], [usual]
    reverses = bool(vary & {"direction", "wheel_acceleration"})
    while at < t_s[-1]:
        lasts = rng.uniform(*LEG_S)
        size = rng.uniform(1.0, FASTEST_RAD_S) if "wheel_speed" in vary else usual
        wanted = size * (rng.choice([-1.0, 1.0]) if reverses else 1.0)
        times += [at + 2.0, at + lasts]
        speeds += [wanted, wanted]
        at += lasts
    return np.interp(t_s, times, speeds)


ROVER = Subject("rover", write_rover, tuple(sorted(CONDITIONS_OF)), can_lift=True, steady=frozenset({"temperature"}))
VEHICLE = Subject(
    "vehicle",
    write_vehicle,
    ("direction", "pitch", "temperature", "torque", "wheel_acceleration", "wheel_speed", "yaw_rate"),
    can_lift=False,
)
SUBJECTS = {subject.name: subject for subject in (ROVER, VEHICLE)}
"""The machines by name."""
