"""The effects that a corrected simulation has already: `[[effects]]` of SIM.toml, as `--corrected` writes them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.corrections.onset_clock import FoundIn
from regolithd.calibration.mismatch.problem.corrections.size_posterior import SizePosterior

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray


def stated_effects(tables: Mapping[str, Any]) -> tuple[Contribution, ...]:
    """Return the effects that SIM.toml has already.

    Raises
    ------
    SimulationError
        When one of them is not as `--corrected` writes it.
    """
    found = []
    for number, effect in enumerate(tables.get("effects", []), 1):
        try:
            found.append(
                Contribution(
                    str(effect["name"]),
                    dict(effect["shape"]),
                    tuple(float(c) for c in effect["coefficients"]),
                    tuple(w if isinstance(w, str) else int(w) for w in effect["wheels"]),
                    float(effect.get("relative_std", 0.0)),
                    str(effect.get("channel", "")),
                    _shape_std(effect),
                    _found_in(effect),
                    _posterior(effect),
                )
            )
        except (KeyError, TypeError, ValueError) as error:
            raise SimulationError(f"effect {number} needs name, shape, coefficients and wheels: {error}") from error
    return tuple(found)


def _shape_std(effect: Mapping[str, Any]) -> dict[str, float]:
    """Return the standard deviations of an effect's shape parameters.

    Raises
    ------
    ValueError
        When one is of no number in its shape, or no standard deviation.
    """
    found = {str(name): float(std) for name, std in dict(effect.get("shape_std", {})).items()}
    numbers = {name for name, value in dict(effect["shape"]).items() if isinstance(value, int | float)}
    if unknown := sorted(set(found) - numbers):
        raise ValueError(f"shape_std has {', '.join(unknown)}, which is no number in its shape")
    if wrong := [name for name, std in found.items() if not 0 <= std < float("inf")]:
        raise ValueError(f"shape_std of {wrong[0]} is {found[wrong[0]]:g}: it is a number from 0 on")
    return found


def _posterior(effect: Mapping[str, Any]) -> SizePosterior | None:
    """Return the density of an effect's size together with the parameters.

    Raises
    ------
    ValueError
        When it is not as `--corrected` writes it.
    """
    if "posterior" not in effect:
        return None
    told = "posterior has parameters, values and covariance, as --corrected writes it: edit none of them, or delete it"
    try:
        of = dict(effect["posterior"])
        names = tuple(str(name) for name in of["parameters"])
        values = tuple(float(value) for value in of["values"])
        matrix = np.array(of["covariance"], np.float64)
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(told) from error
    if len(values) != len(names) or matrix.shape != (len(names) + 1,) * 2 or not _is_covariance(matrix, values):
        raise ValueError(told)
    return SizePosterior.of(dict(zip(names, values, strict=True)), matrix)


def _is_covariance(matrix: NDArray[np.float64], values: Sequence[float]) -> bool:
    """Return whether all numbers are finite, and a matrix is symmetric and positive definite."""
    if not (np.isfinite(matrix).all() and np.isfinite(values).all()) or np.any(np.diag(matrix) <= 0):
        return False
    std = np.sqrt(np.diag(matrix))
    correlation = matrix / np.outer(std, std)
    return bool(np.allclose(correlation, correlation.T) and np.linalg.eigvalsh(correlation)[0] > 0)


def _found_in(effect: Mapping[str, Any]) -> FoundIn | None:
    """Return the recording whose clock an effect's onset is on.

    Raises
    ------
    ValueError
        When it is not as `--corrected` writes it.
    """
    if "found_in" not in effect:
        return None
    try:
        of = dict(effect["found_in"])
        return FoundIn(str(of["digest"]), int(of["instants"]), float(of["end_s"]))
    except (KeyError, TypeError, ValueError) as error:
        told = f"found_in has digest, instants and end_s, as --corrected writes it, not {effect['found_in']!r}"
        raise ValueError(told) from error
