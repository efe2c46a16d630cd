"""A mixed bench: virtual nodes beside real ones, whose PDOs the plant follows."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.devices.decoding.pdo import tpdos
from regolithd.drivers.devices.load_cell import LOAD_CELL
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER, RAD_S_PER_RPM
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.virtual.plant import Measurement
from regolithd.drivers.virtual.rover import KAPVIK, VirtualRover

SYNC = Frame(0, 0x080, b"")
MOTOR_PDO, LOAD_PDO = tpdos(MOTOR_CONTROLLER)[0], tpdos(LOAD_CELL)[0]


class Plant:
    """Keeps what it is asked with."""

    def __init__(self) -> None:
        self.speeds = np.full(6, np.nan)
        self.loads = np.full(6, np.nan)

    def follow(self, load_N: np.ndarray) -> None:
        """Keep the loads."""
        self.loads = load_N

    def measure(self, time_s: float, motor_speed_rad_s: np.ndarray) -> Measurement:
        """Keep the speeds; return constant values."""
        del time_s
        self.speeds = motor_speed_rad_s
        return Measurement(motor_current_A=np.zeros(6), load_N=np.full(6, 50.0))


def powered(plant: Plant, nodes: object = KAPVIK, **options: object) -> VirtualRover:
    """Return a rover whose virtual nodes are switched on."""
    rover = VirtualRover(plant, nodes, **options)  # type: ignore[arg-type]
    rover.power_on(0)
    return rover


def motor_frame(node_id: int, rpm: int) -> Frame:
    """Return the TPDO of a real motor."""
    return Frame(0, MOTOR_PDO.cob_id(node_id), MOTOR_PDO.pack(0x1237, 60, rpm))


def test_the_plant_turns_as_the_real_motors_report() -> None:
    """Only the chosen nodes are there; speeds are in rad/s, forward positive also of a motor mounted mirrored."""
    nodes = (*KAPVIK[2:], NodeDescription(2, MOTOR_CONTROLLER, 1, mirrored=True))
    plant = Plant()
    rover = powered(plant, nodes, virtual={11, 12, 21})
    assert sorted(rover.nodes) == [11, 12, 21]
    rover.take(motor_frame(3, 3000), 1)
    rover.take(motor_frame(2, -2000), 1)
    rover.take(SYNC, 2)
    assert plant.speeds == pytest.approx(np.array([0, 2000, 3000, 0, 0, 0]) * RAD_S_PER_RPM)


def test_a_motor_that_falls_silent_stands_still() -> None:
    """After three SYNCs without its TPDO its speed is 0."""
    plant = Plant()
    rover = powered(plant, KAPVIK, virtual={11})
    rover.take(motor_frame(3, 3000), 1)
    speeds = []
    for now in range(2, 7):
        rover.take(SYNC, now)
        speeds.append(plant.speeds[2])
    assert np.array(speeds) == pytest.approx(np.array([3000, 3000, 3000, 0, 0]) * RAD_S_PER_RPM)


def test_the_plant_is_told_the_loads_of_real_cells() -> None:
    """The other way round: virtual motors, and loads as they are measured; NaN where there is no real cell."""
    plant = Plant()
    rover = powered(plant, KAPVIK, virtual=range(1, 7), follow_loads=plant.follow)
    rover.take(Frame(0, LOAD_PDO.cob_id(13), LOAD_PDO.pack(4321, 0)), 1)
    rover.take(SYNC, 2)
    assert plant.loads[2] == pytest.approx(43.21)
    assert np.isnan(np.delete(plant.loads, 2)).all()


def test_a_virtual_motor_that_is_mounted_mirrored_drives_the_wheel_forward() -> None:
    """By its own count it turns backwards, and so does its current; the plant's wheel turns forward."""
    plant = Plant()
    rover = powered(plant, [NodeDescription(2, MOTOR_CONTROLLER, 1, mirrored=True)])
    rover.nodes[2].device.speed_rpm = -1000.0
    rover.take(SYNC, 1)
    assert plant.speeds[1] == pytest.approx(1000 * RAD_S_PER_RPM)
