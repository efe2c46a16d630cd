"""Fills the dictionary: tangents of the free parameters, every candidate's grid, and curves without a name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.prior import own_name
from regolithd.calibration.mismatch.regression.design_matrix import Dictionary, Group
from regolithd.calibration.mismatch.signal.hat_basis import broken_lines
from regolithd.calibration.mismatch.signal.spectrum import padded_length, power_of_sums

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape, Sharing
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

OWN_SHARE = 1 / 3
"""Of a parameter's standard deviation: what wheels of one make differ by. More hides what differs by row or by load."""
CURVE_KNOTS = 8
TIME_KNOTS = 48
"""Time has no physics of its own that is smooth: spells and beats must show, down to a fortieth of the recording."""
BETWEEN_WHEELS = 0.2
"""Share of a covariate's variance that must be within wheels."""
LEAST_BEATS = 4
"""Beats in a recording, below which a sine over time is no more than a slow curve."""
SHORTEST_BEAT = 5.0
"""Readings in a beat."""
NOT_FOR_CURVES = frozenset({"direction", "wheel_angle", "wheel_acceleration", "place"})


@dataclass(frozen=True)
class Nuisance:
    """The simulation's free parameters: where their tangents are, and how far the priors let them go."""

    names: tuple[str, ...]
    columns: tuple[int, ...]
    precision: Array
    """One over the variance of each scaled coefficient."""


def add_nuisance(dictionary: Dictionary) -> Nuisance:
    """Add ∂prediction/∂parameter of every parameter that the priors leave free, and of each wheel's own part of it."""
    problem, simulation = dictionary.problem, dictionary.problem.simulation
    free = {name: prior.std for name, prior in simulation.parameters.items() if prior.std > 0}
    names, stds, tangents = list(free), list(free.values()), [problem.tangent(name) for name in free]
    wheels = problem.recording.wheels
    for name in free if len(wheels) > 1 else ():
        if name in simulation.own_to_each_wheel:
            names += [own_name(name, wheel) for wheel in wheels]
            stds += [OWN_SHARE * free[name]] * len(wheels)
            tangents += [np.where(np.array(wheels) == wheel, problem.tangent(name), 0.0) for wheel in wheels]
    places = dictionary.append(tangents)
    # A coefficient of a column that was divided by its scale is the parameter's shift times that scale.
    precision = 1 / (np.array(stds) * dictionary.scale[places]) ** 2 if places else np.zeros(0)
    return Nuisance(tuple(names), tuple(places), precision)


def add_candidate(
    dictionary: Dictionary, candidate: Candidate, shapes: Sequence[Shape], quieter: Sequence[float] = ()
) -> list[Group]:
    """Add a candidate in each of these shapes; `quieter` says where there is less noise than in the long run."""
    problem, made, columns = dictionary.problem, [], []
    start = len(dictionary.columns)
    price = 2 * float(np.log(candidate.shape_count(problem)))
    for shape, less in zip(shapes, quieter or [1.0] * len(shapes), strict=True):
        found = np.asarray(candidate.columns(problem, shape), np.float64)
        places = tuple(range(start, start + len(found)))
        start += len(found)
        columns += list(found)
        signs = tuple(c.sign for c in candidate.coefficients[: len(found)])
        signs += (0,) * (len(found) - len(signs))
        paid = price + candidate.prior_penalty(problem, shape)
        made.append(
            Group(
                candidate.name,
                places,
                signs,
                candidate.sharing,
                paid,
                candidate,
                shape,
                quieter=less,
                evidence=candidate.own_channel_evidence(problem, shape),
                alive=np.any(np.where(problem.mask, found, 0.0) != 0, axis=1) if len(found) > 1 else None,
            )
        )
    dictionary.append(columns)
    dictionary.groups += made
    return made


def add_candidates(dictionary: Dictionary, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Add every candidate that this recording can have; return those."""
    fitting = [candidate for candidate in candidates if candidate.applies(dictionary.problem)]
    for candidate in fitting:
        add_candidate(dictionary, candidate, candidate.shapes(dictionary.problem))
    return fitting


def _opposed(problem: Problem, covariate: str) -> dict[str, Array]:
    """Return how an effect may differ over the machine: what tilts or turns it acts oppositely on its two sides."""
    direction = np.nan_to_num(problem.covariates.get("direction", np.ones(problem.mask.shape)))
    if covariate in {"roll", "yaw_rate"} and problem.side is not None:
        return {"drag, opposite sides": direction * problem.side}
    if covariate == "pitch" and problem.row is not None and np.ptp(problem.row) > 0:
        return {"drag, opposite ends": direction * (problem.row - np.mean(problem.row))}
    return {}


def add_curves(dictionary: Dictionary) -> None:
    """Add, for each covariate, broken lines that act as drag, as an offset, and in proportion to the prediction."""
    problem = dictionary.problem
    flavours = {"offset": np.ones(problem.mask.shape), "gain": problem.filled}
    if "direction" in problem.covariates:
        flavours["drag"] = np.nan_to_num(problem.covariates["direction"])
    for name, values in problem.covariates.items():
        if name in NOT_FOR_CURVES:
            continue
        if _tells_wheels_apart(problem, values):
            continue
        curve = np.abs(values) if name == "wheel_speed" else values
        hats = broken_lines(curve, problem.mask, CURVE_KNOTS)
        if len(hats) < 3:
            continue
        for flavour, factor in {**flavours, **_opposed(problem, name)}.items():
            sharing: tuple[Sharing, ...] = ("all",) if "opposite" in flavour else ("all", "one")
            _add_curve(dictionary, name, [hat * factor for hat in hats], flavour, sharing)
    speed = problem.covariates.get("wheel_speed")
    if speed is not None and np.nanmin(speed) < 0:
        # What acts one way only is neither a drag nor an offset.
        _add_curve(dictionary, "wheel_speed", broken_lines(speed, problem.mask, CURVE_KNOTS), "each way")
    flavour = "drag" if "drag" in flavours else "offset"
    hats = broken_lines(problem.covariates["time"], problem.mask, TIME_KNOTS)
    _add_curve(dictionary, "time", [hat * flavours[flavour] for hat in hats], flavour)


def _add_curve(
    dictionary: Dictionary,
    covariate: str,
    columns: Sequence[Array],
    flavour: str,
    sharing: tuple[Sharing, ...] = ("all", "one"),
    price: float = 0.0,
) -> None:
    """Add columns without a name, of either sign."""
    if places := dictionary.append(columns):
        signs = (0,) * len(places)
        dictionary.groups.append(Group(covariate, tuple(places), signs, sharing, price, None, {}, flavour))


def _tells_wheels_apart(problem: Problem, values: Array) -> bool:
    """Say whether a covariate hardly varies but from wheel to wheel: a curve over it would be a name for the wheels."""
    known = values[problem.mask & np.isfinite(values)]
    return problem.variance_within(values) < BETWEEN_WHEELS * float(np.var(known))


def add_beat(dictionary: Dictionary, residual: Array) -> None:
    """Add the sine over time, acting as drag, that the residual [time, wheel] shows most of: what switches on board."""
    problem = dictionary.problem
    along = np.nan_to_num(problem.covariates.get("direction", np.ones(problem.mask.shape)))
    time_s, step_s = problem.time_s[:, 0], problem.recording.step_s
    lowest, highest = LEAST_BEATS / problem.length_s, 1 / (SHORTEST_BEAT * step_s)
    if lowest >= highest:
        return
    place = np.rint(time_s / step_s).astype(np.int64)
    length = padded_length(int(place[-1]))
    frequency_Hz = np.fft.rfftfreq(length, step_s)
    power = np.stack([power_of_sums(place, values, length) for values in (residual * along * problem.mask).T])
    for wheels in (power.sum(axis=0), *power):
        sought = np.where((frequency_Hz >= lowest) & (frequency_Hz <= highest), wheels, 0.0)
        phase = 2 * np.pi * frequency_Hz[np.argmax(sought)] * problem.time_s
        price = 2 * float(np.log(problem.length_s * highest))
        _add_curve(dictionary, "time", [along * np.cos(phase), along * np.sin(phase)], "drag, periodic", price=price)
