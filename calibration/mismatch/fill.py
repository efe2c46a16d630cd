"""Fills the dictionary: tangents of the free parameters, every candidate's grid, and curves without a name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from calibration.mismatch.dictionary import Dictionary, Group

if TYPE_CHECKING:
    from collections.abc import Sequence

    from calibration.mismatch.candidates import Candidate, Shape

Array = NDArray[np.float64]

CURVE_KNOTS = 8
NOT_FOR_CURVES = frozenset({"direction", "wheel_angle", "wheel_acceleration"})


@dataclass(frozen=True)
class Nuisance:
    """The simulation's free parameters: where their tangents are, and how far the priors let them go."""

    names: tuple[str, ...]
    columns: tuple[int, ...]
    precision: Array
    """One over the variance of each scaled coefficient."""


def add_nuisance(dictionary: Dictionary) -> Nuisance:
    """Add ∂prediction/∂parameter of every parameter that the priors leave free."""
    scene = dictionary.scene
    free = [name for name, prior in scene.simulation.parameters.items() if prior.std > 0]
    places = dictionary.append([scene.tangent(name) for name in free])
    stds = np.array([scene.simulation.parameters[name].std for name in free])
    # A coefficient of a column that was divided by its scale is the parameter's shift times that scale.
    precision = 1 / (stds * dictionary.scale[places]) ** 2 if places else np.zeros(0)
    return Nuisance(tuple(free), tuple(places), precision)


def add_candidate(dictionary: Dictionary, candidate: Candidate, shapes: Sequence[Shape]) -> list[Group]:
    """Add a candidate in each of these shapes."""
    scene, made, columns = dictionary.scene, [], []
    start = len(dictionary.columns)
    price = 2 * float(np.log(max(len(candidate.shapes(scene)), 1)))
    for shape in shapes:
        found = np.asarray(candidate.columns(scene, shape), np.float64)
        places = tuple(range(start, start + len(found)))
        start += len(found)
        columns += list(found)
        signs = tuple(c.sign for c in candidate.coefficients[: len(found)])
        signs += (0,) * (len(found) - len(signs))
        made.append(Group(candidate.name, places, signs, candidate.sharing, price, candidate, shape))
    dictionary.append(columns)
    dictionary.groups += made
    return made


def add_candidates(dictionary: Dictionary, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Add every candidate that this recording can have; return those."""
    fitting = [candidate for candidate in candidates if candidate.applies(dictionary.scene)]
    for candidate in fitting:
        add_candidate(dictionary, candidate, candidate.shapes(dictionary.scene))
    return fitting


def add_curves(dictionary: Dictionary) -> None:
    """Add, for each covariate, broken lines that act as drag, as an offset, and in proportion to the prediction."""
    scene = dictionary.scene
    flavours = {"offset": np.ones(scene.mask.shape), "gain": scene.filled}
    if "direction" in scene.covariates:
        flavours["drag"] = np.nan_to_num(scene.covariates["direction"])
    for name, values in scene.covariates.items():
        if name in NOT_FOR_CURVES:
            continue
        curve = np.abs(values) if name == "wheel_speed" else values
        hats = broken_lines(curve, scene.mask, CURVE_KNOTS)
        if len(hats) < 3:
            continue
        for flavour, factor in flavours.items():
            places = dictionary.append([hat * factor for hat in hats])
            signs = (0,) * len(places)
            dictionary.groups.append(Group(name, tuple(places), signs, ("all", "one"), 0.0, None, {}, flavour))


def broken_lines(values: Array, mask: NDArray[np.bool_], knots: int) -> list[Array]:
    """Return hat functions that sum to 1, on knots that share the data evenly; 0 where the covariate is unknown."""
    known = mask & np.isfinite(values)
    if not known.any():
        return []
    inside = values[known]
    low, high = (float(q) for q in np.quantile(inside, [0.005, 0.995]))
    at = np.unique(0.5 * (np.quantile(inside, np.linspace(0.005, 0.995, knots)) + np.linspace(low, high, knots)))
    if len(at) < 3 or at[-1] - at[0] <= 0:
        return []
    clipped = np.clip(np.where(known, values, at[0]), at[0], at[-1])
    hats = [np.interp(clipped, at, row) for row in np.eye(len(at))]
    return [np.where(known, hat, 0.0) for hat in hats]
