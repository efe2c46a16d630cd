"""Each shipped profile: its virtual device boots, is driven, and what it measures arrives in SI units."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np
import pytest
from described import load_cell, makers, motor
from rig import rig, until

from regolithd.drivers.devices.decoding.pdo import rpdos, tpdos
from regolithd.drivers.devices.device import Setting
from regolithd.drivers.devices.eds import EDS_FOLDER
from regolithd.drivers.devices.eds.write import SHEETS, text
from regolithd.drivers.devices.load_cell import LOAD
from regolithd.drivers.devices.motor_controller import MOTOR_CURRENT, MOTOR_SPEED
from regolithd.drivers.devices.profiles.choice import DeviceChoice, Placement
from regolithd.drivers.devices.profiles.identity import expected_identity
from regolithd.drivers.master.events import NodeBooted, NodeBootFailed
from regolithd.drivers.virtual.plant import Measurement

if TYPE_CHECKING:
    from regolithd.drivers.devices.node import NodeDescription

SPEED = 50.0  # rad/s at the motor
MOTORS = ("epos24", "epos2", "epos4", "cia402")
CHOICES = {name: DeviceChoice(name) for name in MOTORS} | makers()
CELLS = {
    "newton": DeviceChoice("newton"),
    "cia404": DeviceChoice("cia404"),
    "cia401": DeviceChoice("cia401", channel=2, placements=(Placement("load_N", scale=0.0125),)),
}


class World:
    """A plant with one current and one load for each wheel."""

    def measure(self, time_s: float, motor_speed_rad_s: np.ndarray) -> Measurement:
        """Return constant values."""
        del time_s, motor_speed_rad_s
        wheel = np.arange(6.0)
        return Measurement(motor_current_A=-0.040 - 0.010 * wheel, load_N=40.0 + 2.5 * wheel)


async def drive_and_measure(node: NodeDescription) -> None:
    """Boot a drive, turn it, and compare current and speed with the plant and the command."""
    async with rig([node], plant=World(), gear_ratio=1.0) as r:
        booted = await r.wait_for_event(NodeBooted)
        assert booted.identity.device_type & 0xFFFF == 402
        await r.network.enable()
        await r.network.set_speed((0.0, 0.0, SPEED, 0.0, 0.0, 0.0))
        await until(lambda: abs(r.latest(3, MOTOR_SPEED) - SPEED) < 0.2, "the commanded speed")
        assert r.latest(3, MOTOR_CURRENT) == pytest.approx(-0.060, abs=1e-3)
        assert r.rover.nodes[3].device.speed_rad_s == pytest.approx(SPEED, abs=0.2)
        await r.network.quick_stop()


@pytest.mark.parametrize("name", CHOICES)
async def test_a_profile_of_a_drive_boots_drives_and_measures(name: str) -> None:
    """One line in `rover.toml` is enough: current and speed agree with what the drive does."""
    await drive_and_measure(motor(CHOICES[name]))


@pytest.mark.parametrize("profile", CELLS)
async def test_a_profile_of_a_load_cell_measures(profile: str) -> None:
    """The load arrives in newtons, whatever object and unit the amplifier has."""
    async with rig([load_cell(CELLS[profile])], plant=World()) as r:
        await r.wait_for_event(NodeBooted)
        await until(lambda: np.isfinite(r.latest(14, LOAD)), "a load")
        assert r.latest(14, LOAD) == pytest.approx(47.5, abs=0.05)


@pytest.mark.parametrize(
    ("node", "number"),
    [(motor(CHOICES["cia402"]), 402), (load_cell(CELLS["cia404"]), 404), (load_cell(CELLS["cia401"]), 401)],
)
def test_a_device_of_a_standard_tells_the_standard_s_number(node: NodeDescription, number: int) -> None:
    """The low word of the device type: drives, measuring devices, and modules of inputs and outputs."""
    expected = expected_identity(node.device)
    assert expected.device_type is not None
    assert expected.device_type & 0xFFFF == number


async def test_mixed_drives_share_one_bus() -> None:
    """Four makes of drives are booted, enabled and turned together."""
    nodes = [motor(DeviceChoice(name), node_id, node_id - 1) for node_id, name in enumerate(MOTORS, start=1)]
    async with rig(nodes, plant=World(), gear_ratio=1.0) as r:
        await r.network.settled()
        await r.network.enable()
        await r.network.set_speed((SPEED,) * 6)
        for node in nodes:
            await until(lambda node=node: abs(r.latest(node.node_id, MOTOR_SPEED) - SPEED) < 0.2, str(node.node_id))
            assert r.latest(node.node_id, MOTOR_CURRENT) == pytest.approx(-0.030 - 0.010 * node.node_id, abs=1e-3)


def test_ten_bytes_take_two_tpdos() -> None:
    """Status, current and speed of an EPOS4 are ten bytes; those of an EPOS2 eight, which one PDO holds."""
    sizes = {name: [pdo.layout.size for pdo in tpdos(motor(DeviceChoice(name)).device)] for name in MOTORS}
    assert sizes == {"epos24": [8], "epos2": [8], "epos4": [6, 4], "cia402": [8]}
    assert [pdo.layout.size for pdo in rpdos(motor(DeviceChoice("epos4")).device)] == [6]


async def test_a_unit_in_thousandths_is_followed() -> None:
    """Speed and command are scaled by 0x60A9: one that says mrpm gives the same speed in rad/s."""
    limits = tuple(Setting(index, 0, 10**8) for index in (0x607F, 0x6083, 0x6084, 0x6085))  # in mrpm as well
    node = motor(DeviceChoice("epos4", settings=limits))
    async with rig([node], plant=World(), gear_ratio=1.0, faults=["off 3"]) as r:
        dictionary = r.rover.nodes[3].dictionary
        entry = dictionary.entries[0x60A9, 0]
        dictionary.entries = {
            **dictionary.entries,
            (0x60A9, 0): type(entry)(**_fields(entry) | {"default": 0xFDB44700}),
        }
        r.rover.inject_fault("on 3")
        await r.wait_for_event(NodeBooted)
        await r.network.enable()
        await r.network.set_speed((SPEED,) * 6)
        await until(lambda: abs(r.latest(3, MOTOR_SPEED) - SPEED) < 0.001, "the commanded speed")


@pytest.mark.parametrize(
    ("value", "said"),
    [(0x00210000, "no angle per time"), (0x05B44700, "one step of the raw value would be"), (0, "no angle")],
)
async def test_a_unit_that_cannot_be_is_refused(value: int, said: str) -> None:
    """A drive whose 0x60A9 is no velocity, or absurd, is not booted; object and value are named."""
    node = motor(DeviceChoice("epos4"))
    async with rig([node], faults=["off 3"]) as r:
        dictionary = r.rover.nodes[3].dictionary
        entry = dictionary.entries[0x60A9, 0]
        dictionary.entries = {**dictionary.entries, (0x60A9, 0): type(entry)(**_fields(entry) | {"default": value})}
        r.rover.inject_fault("on 3")
        failed = await r.wait_for_event(NodeBootFailed)
        assert failed.reason == "unknown-unit"
        assert f"0x60A9:00 = 0x{value:X}" in failed.text
        assert said in failed.text


def _fields(entry: object) -> dict[str, object]:
    return {
        name: getattr(entry, name) for name in ("format", "readable", "writable", "mappable", "default", "low", "high")
    }


@pytest.mark.parametrize("sheet", SHEETS, ids=lambda sheet: sheet.name)
def test_the_eds_files_are_those_that_the_script_writes(sheet: object) -> None:
    """`python -m regolithd.drivers.devices.eds.write` changes nothing."""
    path = EDS_FOLDER / f"{sheet.name}.eds"
    if os.environ.get("GOLDEN") == "write":
        path.write_text(text(sheet), encoding="utf-8")
    assert path.read_text(encoding="utf-8") == text(sheet)
