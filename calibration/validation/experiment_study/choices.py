"""Three choices of the next experiment: what the answer proposes, one covariate alone, and a random one.

Nothing here knows the solver: the first answer's JSON is all that there is to go by.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from regolithd.calibration.validation.blind_trials.recordings.generator import Plan
from regolithd.calibration.validation.blind_trials.recordings.traverse import ProposedExperiment

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.validation.experiment_study.subjects import Subject

Choice = Literal["proposed", "covariate-wise", "random"]
CHOICES: tuple[Choice, ...] = get_args(Choice)
CONCEALED = (
    "coulomb-friction",
    "viscous-friction",
    "load-dependent-efficiency",
    "stribeck-friction",
    "cold-lubricant-friction",
)
"""Effects in rotation: at one speed and temperature each may pass for the others."""
COVARIATE_OF = {
    "coulomb-friction": "direction",
    "viscous-friction": "wheel_speed",
    "stribeck-friction": "wheel_speed",
    "quadratic-drag": "wheel_speed",
    "wheel-angle-ripple": "wheel_speed",
    "cold-lubricant-friction": "temperature",
    "torque-constant-temperature": "temperature",
    "load-dependent-efficiency": "torque",
    "rotor-inertia": "wheel_acceleration",
    "grade-resistance": "pitch",
    "turning-resistance": "yaw_rate",
    "slip-sinkage": "slip",
    "current-sensor-bias": "direction",
}
"""The covariate in which an effect's law lies (the contract's table), for those that a drive can vary."""
MOST_VARIED = 3
"""Covariates that the random experiment varies at most."""


def plans(seed: int, count: int) -> list[Plan]:
    """Return the plans of a study: one speed on flat ground, one effect each."""
    return [Plan(number, seed, "constant", (CONCEALED[number % len(CONCEALED)],)) for number in range(count)]


def experiments(answer: Mapping[str, Any], plan: Plan, subject: Subject) -> dict[Choice, ProposedExperiment]:
    """Return the experiment of each choice; none where the answer has no set of indistinguishable effects."""
    proposed = ProposedExperiment.of_answer(answer)
    if proposed is None:
        return {}
    return {
        "proposed": proposed,
        "covariate-wise": ProposedExperiment(frozenset({own_covariate(answer)}), 0.0, lift=False),
        "random": random_experiment(plan, subject),
    }


def own_covariate(answer: Mapping[str, Any]) -> str:
    """Return the covariate of the effect that is named, or else of the first of the set that has one."""
    names = [effect["name"] for effect in answer["effects"]]
    names += [name for one in answer["indistinguishable"] for name in one["effects"]]
    return next((COVARIATE_OF[name] for name in names if name in COVARIATE_OF), "wheel_speed")


def random_experiment(plan: Plan, subject: Subject) -> ProposedExperiment:
    """Return one to three covariates that a drive can vary, with or without a part without load."""
    rng = np.random.default_rng([plan.seed, 5, plan.number])
    varied = rng.choice(subject.varied, size=int(rng.integers(1, MOST_VARIED + 1)), replace=False)
    return ProposedExperiment(frozenset(map(str, varied)), 0.0, lift=subject.can_lift and bool(rng.uniform() < 0.5))
