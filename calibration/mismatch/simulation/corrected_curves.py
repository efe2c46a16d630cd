"""The empirical curves that a corrected simulation has: `[[empirical_curves]]` of SIM.toml."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.corrections.empirical_curve import EmpiricalCurve, StatedCurve

if TYPE_CHECKING:
    from collections.abc import Mapping

TABLE = "empirical_curves"
STATEMENT = (
    "No physics: a curve fitted to one recording, for what no known effect explains. "
    "It holds from the first to the last value of `at`; outside it keeps its end values."
)
"""What stands with each curve in the file."""


def stated_curves(tables: Mapping[str, Any]) -> tuple[StatedCurve, ...]:
    """Return the empirical curves that SIM.toml has.

    Raises
    ------
    SimulationError
        When one of them is not as `--corrected --empirical` writes it.
    """
    entries = tables.get(TABLE, [])
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise SimulationError(f"{TABLE} are tables, [[{TABLE}]], as --corrected --empirical writes them", (TABLE,))
    return tuple(_curve(number, entry) for number, entry in enumerate(entries, 1))


def _curve(number: int, entry: Mapping[str, Any]) -> StatedCurve:
    try:
        rows = {name: tuple(float(each) for each in entry[name]) for name in ("at", "value", "low", "high")}
        curve = EmpiricalCurve(
            coupling=str(entry["coupling"]),
            magnitude=bool(entry["magnitude"]),
            unit=str(entry.get("unit", "")),
            covariate_unit=str(entry.get("covariate_unit", "")),
            **rows,
            held_out_rmse_before=float(entry.get("held_out_rmse_before", "nan")),
            held_out_rmse_after=float(entry.get("held_out_rmse_after", "nan")),
        )
        wheels = tuple(w if isinstance(w, str) else int(w) for w in entry["wheels"])
        stated = StatedCurve(str(entry.get("channel", "")), wheels, str(entry["covariate"]), curve)
    except (KeyError, TypeError, ValueError) as error:
        raise SimulationError(
            f"empirical curve {number} needs wheels, covariate, coupling, magnitude, at, value, low and high: {error}",
            (TABLE,),
        ) from error
    if len({len(row) for row in rows.values()}) > 1 or len(curve.at) < 2 or np.any(np.diff(curve.at) <= 0):
        raise SimulationError(
            f"empirical curve {number}: at must ascend, and value, low and high have as many numbers as it", (TABLE,)
        )
    return stated


def entry_of(stated: StatedCurve) -> dict[str, Any]:
    """Return an entry of `[[empirical_curves]]`."""
    curve = {name: list(each) if isinstance(each, tuple) else each for name, each in asdict(stated.curve).items()}
    place = {"channel": stated.channel, "wheels": list(stated.wheels), "covariate": stated.covariate}
    return {"statement": STATEMENT, **place, **curve}
