"""What a simulation states as attributes, checked: the channel, inputs, priors and sensor errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, get_args

from regolithd.calibration.mismatch.data.slow_channels import Between
from regolithd.calibration.mismatch.errors import SimulationError, did_you_mean
from regolithd.calibration.mismatch.problem.prior import Prior, SensorError
from regolithd.calibration.mismatch.simulation.simulation import Simulation
from regolithd.calibration.mismatch.simulation.user_code import defined_at

if TYPE_CHECKING:
    from collections.abc import Iterator


def check_statement(simulation: Simulation) -> None:
    """Check a simulation's attributes.

    Raises
    ------
    SimulationError
        With every mistake, and the file and line of the class.
    """
    if mistakes := list(_mistakes(simulation)):
        raise SimulationError(f"{type(simulation).__name__}{defined_at(type(simulation))}: {'; '.join(mistakes)}")


def _mistakes(simulation: Simulation) -> Iterator[str]:
    if not isinstance(simulation.channels, Mapping):
        yield f'channels must be a dict from columns to units, {{"thrust_N": "N"}}, not {simulation.channels!r}'
    elif not simulation.channels and not isinstance(getattr(simulation, "channel", None), str):
        yield 'it must state the recorded column that it predicts: channel = "torque_Nm"'
    for name in ("unit", "wheel_column", "unloaded_experiment"):
        if not isinstance(getattr(simulation, name), str):
            yield f"{name} must be text, not {getattr(simulation, name)!r}"
    if not isinstance(simulation.one_way, bool | None):
        yield f"one_way must be True or False, not {simulation.one_way!r}"
    at_degC = simulation.motor_constant_at_degC
    if at_degC is not None and (isinstance(at_degC, bool) or not isinstance(at_degC, int | float)):
        yield f"motor_constant_at_degC must be a number, or None, not {at_degC!r}"
    for name in ("inputs", "own_tables", "without_effects"):
        found = getattr(simulation, name)
        if not isinstance(found, tuple | list) or not all(isinstance(each, str) for each in found):
            yield f'{name} must be a tuple of names, ("speed_rad_s",) with its comma, not {found!r}'
    if getattr(simulation.predict, "__func__", None) is Simulation.predict:
        yield "it needs a method predict(self, inputs, values)"
    yield from _wrong_priors(simulation)
    yield from _wrong_columns(simulation)


def _wrong_priors(simulation: Simulation) -> Iterator[str]:
    if not isinstance(simulation.parameters, Mapping):
        yield f"parameters must be a dict from names to Prior(value, std, unit), not {simulation.parameters!r}"
        return
    for name, prior in simulation.parameters.items():
        if not isinstance(prior, Prior):
            yield f'parameters["{name}"] must be Prior(value, std, unit), not {prior!r}'
        elif not all(isinstance(x, int | float) and math.isfinite(x) for x in (prior.value, prior.std)):
            yield f'parameters["{name}"] must have a finite value and std, not {prior!r}'
        elif prior.std < 0:
            yield f'parameters["{name}"] must have a std of 0 (exact) or more, not {prior.std!r}'
        elif prior.own and name not in simulation.own_to_each_wheel:
            yield f"{name} has deviations of single wheels (own), and is not in own_to_each_wheel"
    for name in simulation.own_to_each_wheel:
        if name not in simulation.parameters:
            yield f"own_to_each_wheel names {name}, which is no parameter; {did_you_mean(name, simulation.parameters)}"
    yield from _wrong_parameter_effects(simulation)


def _wrong_parameter_effects(simulation: Simulation) -> Iterator[str]:
    found = simulation.parameter_effects
    if not isinstance(found, Mapping) or not all(isinstance(name, str) for name in (*found, *found.values())):
        yield f'parameter_effects must be a dict of names, {{"friction_Nm": "coulomb-friction"}}, not {found!r}'
        return
    for name in found:
        if name not in simulation.parameters:
            yield f"parameter_effects names {name}, which is no parameter; {did_you_mean(name, simulation.parameters)}"


def _wrong_columns(simulation: Simulation) -> Iterator[str]:
    for name, error in simulation.sensors.items():
        if not isinstance(error, SensorError):
            yield f'sensors["{name}"] must be SensorError(relative=…, absolute=…), not {error!r}'
    for name, how in simulation.between_readings.items():
        if how not in get_args(Between):
            yield f'between_readings["{name}"] must be one of {", ".join(get_args(Between))}, not {how!r}'
