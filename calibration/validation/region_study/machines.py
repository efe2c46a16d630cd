"""Three machines that are linear in their parameters, the regions in which their laws fail, and their recordings.

What is recorded is written by this file alone; `Stated` is the simulation that the engine is given. A case has none,
one or two regions: beyond or below a value of a covariate, or between two; or the law fails smoothly everywhere. The
size of what is left out is stated in standard deviations of the noise, root mean square over the region.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from regolithd.calibration.mismatch import Prior, Simulation

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.random import Generator

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Columns = dict[str, Array]
Kind = Literal["beyond", "below", "between"]
Group = Literal["none", "everywhere", "one", "two"]

ROWS, STEP_S = 3000, 0.5
PRIOR = 0.2
"""Standard deviation of each parameter's prior, as a share of its value."""
SPREAD = 0.1
"""Standard deviation of the true values about the stated ones."""
SIZES = (1.0, 3.0)
"""Root mean square of what is left out in a region, in standard deviations of the noise."""
CORRELATION = 4.0
"""Autocorrelation time of the correlated noise [readings]."""


@dataclass(frozen=True, eq=False)
class Failure:
    """A way in which a law may fail.

    Attributes
    ----------
    covariate: what bounds it
    kind: on which side of the bound, or between two
    form: what is left out, as a function of the columns and of the distance from the bound over the region's width
    """

    covariate: str
    kind: Kind
    form: Callable[[Columns, Array], Array]


@dataclass(frozen=True, eq=False)
class Machine:
    """A machine: its inputs, its law and how that may fail.

    Attributes
    ----------
    parameters: stated values
    columns: the recorded inputs, from a random generator
    tangents: ∂channel/∂parameter, by parameter
    covariates: the recorded column of each covariate that a residual may be ordered by
    failures: two ways in which the law may fail
    noise: standard deviation of the channel's noise
    """

    name: str
    channel: str
    unit: str
    parameters: dict[str, float]
    columns: Callable[[Generator], Columns]
    tangents: Callable[[Columns], Columns]
    covariates: dict[str, str]
    failures: tuple[Failure, Failure]
    noise: float


@dataclass(frozen=True, eq=False)
class Case:
    """A recording and what is true of it.

    Attributes
    ----------
    recorded: columns, with the channel and `t_s`
    true: the parameters' values
    failing: rows in which the law fails
    bounds: of the regions, by covariate
    group: how many regions there are
    correlated: whether the noise is
    """

    machine: Machine
    recorded: Columns
    true: dict[str, float]
    failing: Mask
    bounds: dict[str, tuple[float, ...]]
    group: Group
    correlated: bool


class Stated(Simulation):
    """The law as stated, without its failures."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self.channel, self.unit = machine.channel, machine.unit  # type: ignore[misc]
        self.parameters = {name: Prior(value, PRIOR * abs(value)) for name, value in machine.parameters.items()}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return Σ parameter × tangent."""
        tangents = self._machine.tangents(dict(inputs))
        return np.asarray(sum(values[name] * tangents[name] for name in tangents))

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the machine's covariates, and the time."""
        return {name: inputs[column] for name, column in self._machine.covariates.items()} | {"time": inputs["t_s"]}


def wander(rng: Generator, low: float, high: float, periods_s: tuple[float, float, float]) -> Array:
    """Return a smooth random course between two values, shape (row,)."""
    t_s = np.arange(ROWS) * STEP_S
    waves = [
        np.sin(2 * np.pi * t_s / (period * rng.uniform(0.8, 1.25)) + rng.uniform(0, 2 * np.pi)) for period in periods_s
    ]
    course = np.sum(waves, axis=0)
    return np.asarray(low + (high - low) * (course - course.min()) / np.ptp(course))


def joint_columns(rng: Generator) -> Columns:
    """Return the inputs of a robot's joint: angle, speed, temperature."""
    angle = wander(rng, -1.2, 1.3, (31.0, 17.0, 71.0))
    return {
        "angle_rad": angle,
        "speed_rad_s": np.gradient(angle, STEP_S),
        "grease_degC": wander(rng, -10.0, 40.0, (600.0, 260.0, 97.0)),
    }


def pump_columns(rng: Generator) -> Columns:
    """Return the inputs of a pump: speed, flow, temperature of the oil."""
    return {
        "speed_rpm": wander(rng, 600.0, 3000.0, (43.0, 23.0, 180.0)),
        "flow_l_min": wander(rng, 5.0, 60.0, (37.0, 90.0, 14.0)),
        "oil_degC": wander(rng, 5.0, 60.0, (700.0, 310.0, 120.0)),
    }


def room_columns(rng: Generator) -> Columns:
    """Return the inputs of a heated room: temperature difference, sun, wind, outdoor temperature."""
    outdoor = wander(rng, -12.0, 18.0, (400.0, 190.0, 61.0))
    return {
        "difference_K": 21.0 + wander(rng, -1.0, 1.0, (53.0, 29.0, 11.0)) - outdoor,
        "sun_W_m2": np.maximum(wander(rng, -300.0, 700.0, (240.0, 75.0, 33.0)), 0.0),
        "wind_m_s": wander(rng, 0.0, 14.0, (47.0, 19.0, 130.0)),
        "outdoor_degC": outdoor,
    }


JOINT = Machine(
    name="joint",
    channel="torque_Nm",
    unit="N·m",
    parameters={"gravity_Nm": 10.0, "coulomb_Nm": 2.0},
    columns=joint_columns,
    tangents=lambda c: {"gravity_Nm": np.sin(c["angle_rad"]), "coulomb_Nm": np.sign(c["speed_rad_s"])},
    covariates={"position": "angle_rad", "wheel_speed": "speed_rad_s", "temperature": "grease_degC"},
    failures=(
        Failure("position", "beyond", lambda _, depth: 0.3 + depth),
        Failure("temperature", "between", lambda c, _: np.sign(c["speed_rad_s"])),
    ),
    noise=0.4,
)
PUMP = Machine(
    name="pump",
    channel="power_W",
    unit="W",
    parameters={"idle_W": 120.0, "head_W_min_l": 9.0, "windage_W": 150.0},
    columns=pump_columns,
    tangents=lambda c: {
        "idle_W": np.ones_like(c["speed_rpm"]),
        "head_W_min_l": c["flow_l_min"],
        "windage_W": (c["speed_rpm"] / 3000.0) ** 3,
    },
    covariates={"speed": "speed_rpm", "flow": "flow_l_min", "temperature": "oil_degC"},
    failures=(
        Failure("speed", "beyond", lambda _, depth: depth + depth**2),
        Failure("flow", "between", lambda _, depth: 1.0 + 0 * depth),
    ),
    noise=12.0,
)
ROOM = Machine(
    name="room",
    channel="heat_W",
    unit="W",
    parameters={"loss_W_K": 90.0, "aperture_m2": -2.0},
    columns=room_columns,
    tangents=lambda c: {"loss_W_K": c["difference_K"], "aperture_m2": c["sun_W_m2"]},
    covariates={"outdoor": "outdoor_degC", "wind": "wind_m_s", "sun": "sun_W_m2"},
    failures=(
        Failure("wind", "beyond", lambda c, depth: depth * c["difference_K"]),
        Failure("outdoor", "between", lambda _, depth: 1.0 + 0.5 * depth),
    ),
    noise=120.0,
)
MACHINES = (JOINT, PUMP, ROOM)


def case_of(machine: Machine, seed: int, group: Group, *, correlated: bool) -> Case:
    """Return a recording of a machine whose law fails in so many regions."""
    rng = np.random.default_rng([seed, int(correlated), *group.encode(), *machine.name.encode()])
    columns = machine.columns(rng)
    true = {name: value * (1 + SPREAD * rng.normal()) for name, value in machine.parameters.items()}
    tangents = machine.tangents(columns)
    reading = np.asarray(sum(true[name] * tangents[name] for name in tangents))
    failing = np.zeros(ROWS, np.bool_)
    bounds = {}
    if group == "everywhere":
        reading = reading + smooth(machine, columns, rng)
        failing = ~failing
    for place in rng.permutation(2)[: {"one": 1, "two": 2}.get(group, 0)]:
        failure = machine.failures[place]
        inside, added, bounds[failure.covariate] = failed(machine, failure, columns, rng)
        reading = reading + added
        failing |= inside
    reading = reading + machine.noise * noise(rng, correlated=correlated)
    recorded = {"t_s": np.arange(ROWS) * STEP_S, **columns, machine.channel: reading}
    return Case(machine, recorded, true, failing, bounds, group, correlated)


def smooth(machine: Machine, columns: Columns, rng: Generator) -> Array:
    """Return a law over the whole of one covariate that is left out: a square, an exponential, or a sine."""
    values = columns[machine.covariates[machine.failures[rng.integers(2)].covariate]]
    scaled = (values - values.min()) / np.ptp(values)
    law = (scaled**2, np.exp(-3 * scaled), np.sin(2 * np.pi * scaled))[rng.integers(3)]
    return np.asarray(rng.uniform(*SIZES) * machine.noise * law / np.std(law))


def failed(
    machine: Machine, failure: Failure, columns: Columns, rng: Generator
) -> tuple[Mask, Array, tuple[float, ...]]:
    """Return where a law fails, what is left out there, and the bounds."""
    values = columns[machine.covariates[failure.covariate]]
    share = rng.uniform(0.12, 0.3)
    if failure.kind == "between":
        start = rng.uniform(0.2, 0.75 - share)
        low, high = np.quantile(values, (start, start + share))
        distance = values - low
    elif failure.kind == "beyond":
        low, high = np.quantile(values, 1 - share), values.max() + 1.0
        distance = values - low
    else:
        low, high = values.min() - 1.0, np.quantile(values, share)
        distance = high - values
    inside = np.asarray((values >= low) & (values < high))
    depth = np.where(inside, distance / distance[inside].max(), 0.0)
    added = np.where(inside, failure.form(columns, depth), 0.0)
    size = rng.uniform(*SIZES) * machine.noise / np.sqrt(np.mean(added[inside] ** 2))
    bounds = {"beyond": (low,), "below": (high,), "between": (low, high)}[failure.kind]
    return inside, size * added, tuple(float(each) for each in bounds)


def noise(rng: Generator, *, correlated: bool) -> Array:
    """Return noise of variance 1: white, or of first order with the autocorrelation time `CORRELATION`."""
    white = rng.normal(size=ROWS + 200)
    if not correlated:
        return white[200:]
    # The autocorrelation time (1 + a) / (1 − a) of a first-order process.
    a = (CORRELATION - 1) / (CORRELATION + 1)
    return np.asarray(np.sqrt(1 - a**2) * lfilter([1.0], [1.0, -a], white)[200:])
