"""The temperature in degrees Celsius: the laws of lubricants and magnets have fixed points on that scale."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.problem.words import column_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.problem.problem import Problem

ICE_POINT_K = 273.15
LOWEST_IN_KELVIN = 150.0
"""Reading that no motor or gearbox stays above in °C, and none below in K (a choice: −123 °C)."""


def known_temperature_degC(problem: Problem) -> NDArray[np.float64]:
    """Return the temperature [°C], 0 where it is not known, shape (time, wheel)."""
    return problem.once("temperature in degrees Celsius", lambda: np.nan_to_num(temperature_degC(problem)))


def temperature_degC(problem: Problem) -> NDArray[np.float64]:
    """Return the temperature [°C], shape (time, wheel).

    The unit is that of the recording's column which the covariate is. Where it is none of them (a sum, a column without
    a unit in its name), readings that are never below 150 are in kelvin.
    """
    temperature = problem.covariates["temperature"]
    ending = _unit_of_column(problem, temperature)
    if ending == "degF":
        return (temperature - 32.0) / 1.8
    in_kelvin = (
        float(np.min(temperature[problem.mask & np.isfinite(temperature)], initial=np.inf)) > LOWEST_IN_KELVIN
        if ending is None
        else ending == "K"
    )
    return temperature - ICE_POINT_K if in_kelvin else temperature


def _unit_of_column(problem: Problem, values: NDArray[np.float64]) -> str | None:
    """Return the unit in the name of the column that has these values, if there is one."""
    channels = problem.recording.channels
    of_temperature = {name: read for name, read in channels.items() if name.endswith(("_degC", "_degF", "_K"))}
    column = column_of(values, of_temperature)
    return None if column is None else column.rsplit("_", 1)[1]
