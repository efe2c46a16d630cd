"""Keep each estimate of the daemon beside the ground truth of the virtual rover at that moment."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from regolithd.calibration.posterior.estimator import Posterior
    from regolithd.daemon.pipeline.snapshot import Array, Estimate
    from regolithd.daemon.simulator.virtual_rover import GroundTruth, VirtualWorld
    from regolithd.drivers.master.events import NetworkEvent

    Record = tuple[Estimate, GroundTruth]


class GroundTruthLog:
    """A sink of the service that keeps estimates beside the ground truth."""

    def __init__(self, world: VirtualWorld) -> None:
        self._world = world
        self.records: list[Record] = []
        self.events: list[NetworkEvent] = []

    def estimate(self, estimate: Estimate) -> None:
        """Keep the estimate with the present ground truth."""
        if self._world.truth is not None:
            self.records.append((estimate, self._world.truth))

    def event(self, event: NetworkEvent) -> None:
        """Keep the event."""
        self.events.append(event)

    async def run(self) -> None:
        """Wait until cancelled; nothing runs in the background."""
        await asyncio.Event().wait()


@dataclass(frozen=True, slots=True)
class WheelOnSoil:
    """Means of one wheel's estimates and of the ground truth while it was on one soil, after the filter had settled."""

    wheel: int
    soil: str
    records: int
    torque_Nm: float
    true_torque_Nm: float
    cohesion_Pa: float
    true_cohesion_Pa: float
    friction_angle_rad: float
    true_friction_angle_rad: float
    outside: float  # fraction of the records with an input outside the training range


def wheels_on_soils(records: list[Record], settle_s: float) -> list[WheelOnSoil]:
    """Return the means of each wheel on each soil, in the order driven, leaving out `settle_s` after each change."""
    found = []
    for wheel in range(6):
        driven = [(estimate, truth) for estimate, truth in records if estimate.valid[wheel]]
        soils = list(dict.fromkeys(truth.soils[wheel] for _, truth in driven))
        for soil in soils:
            on_it = [(estimate, truth) for estimate, truth in driven if truth.soils[wheel] == soil]
            begun = on_it[0][1].time_s
            settled = [pair for pair in on_it if pair[1].time_s - begun >= settle_s]
            if settled:
                found.append(_means(wheel, soil, settled))
    return found


def _means(wheel: int, soil: str, pairs: list[Record]) -> WheelOnSoil:
    def mean(values: list[Array]) -> float:
        return float(np.mean([value[wheel] for value in values]))

    estimates, truths = [estimate for estimate, _ in pairs], [truth for _, truth in pairs]
    return WheelOnSoil(
        wheel=wheel + 1,
        soil=soil,
        records=len(pairs),
        torque_Nm=mean([estimate.smoothed_torque_Nm for estimate in estimates]),
        true_torque_Nm=mean([truth.torque_Nm for truth in truths]),
        cohesion_Pa=mean([estimate.cohesion_Pa for estimate in estimates]),
        true_cohesion_Pa=mean([truth.cohesion_Pa for truth in truths]),
        friction_angle_rad=mean([estimate.friction_angle_rad for estimate in estimates]),
        true_friction_angle_rad=mean([truth.friction_angle_rad for truth in truths]),
        outside=float(np.mean([estimate.outside[:, wheel].any() for estimate in estimates])),
    )


@dataclass(frozen=True, slots=True)
class PosteriorOnSoil:
    """The last posterior of all six wheels while all were on one soil, and that soil's true values."""

    soil: str
    posterior: Posterior
    true_cohesion_Pa: float
    true_friction_angle_rad: float


def posteriors_on_soils(records: list[Record]) -> list[PosteriorOnSoil]:
    """Return the last posterior on each soil that was under all six wheels, in the order driven."""
    last: dict[str, PosteriorOnSoil] = {}
    for estimate, truth in records:
        if estimate.posterior is not None and len(set(truth.soils)) == 1:
            soil = truth.soils[0]
            angle = float(truth.friction_angle_rad[0])
            last[soil] = PosteriorOnSoil(soil, estimate.posterior, float(truth.cohesion_Pa[0]), angle)
    return list(last.values())
