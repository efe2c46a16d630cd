"""The virtual ground-speed sensor: what its objects hold of what the plant states."""

from __future__ import annotations

import numpy as np
import pytest
from virtual_master import Master

from regolithd.drivers.virtual.plant import Measurement


class Plant:
    """A plant that states the speeds given to it, and else what every plant has to state."""

    def __init__(self, **speeds: object) -> None:
        self._speeds = speeds

    def measure(self, time_s: float, motor_speed_rad_s: np.ndarray) -> Measurement:
        """Return the speeds."""
        del time_s, motor_speed_rad_s
        return Measurement(motor_current_A=np.zeros(6), load_N=np.zeros(6), **self._speeds)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("plant", "body", "hubs"),
    [
        (Plant(), 0, [0] * 6),
        (
            Plant(ground_speed_m_s=0.05, hub_speed_m_s=np.full(6, 0.05) * np.arange(6)),
            5000,
            list(range(0, 30000, 5000)),
        ),
    ],
    ids=["states nothing", "moves"],
)
def test_speeds_are_in_steps_of_a_hundredth_of_a_millimetre_per_second(
    plant: Plant, body: int, hubs: list[int]
) -> None:
    """Body and hubs; a plant that states no speed stands still."""
    master = Master(plant=plant)
    master.wait(1)
    node = master.node(22)
    assert node.dictionary.get(0x2100, 0) == body
    assert [node.dictionary.get(0x2101, wheel) for wheel in range(1, 7)] == hubs
