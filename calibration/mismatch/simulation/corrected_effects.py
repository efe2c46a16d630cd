"""The effects that a corrected simulation has already: `[[effects]]` of SIM.toml, as `--corrected` writes them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from regolithd.calibration.mismatch.answer import Contribution
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.onset_clock import FoundIn

if TYPE_CHECKING:
    from collections.abc import Mapping


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
        When one is of no number in its shape.
    """
    found = {str(name): float(std) for name, std in dict(effect.get("shape_std", {})).items()}
    numbers = {name for name, value in dict(effect["shape"]).items() if isinstance(value, int | float)}
    if unknown := sorted(set(found) - numbers):
        raise ValueError(f"shape_std has {', '.join(unknown)}, which is no number in its shape")
    return found


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
