"""Nodes whose EDS files use CiA 306's compact storage boot and measure as others do."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from described import load_cell, motor
from rig import rig, until

from regolithd.drivers.devices.eds import EDS_FOLDER
from regolithd.drivers.devices.load_cell import LOAD
from regolithd.drivers.devices.motor_controller import MOTOR_SPEED
from regolithd.drivers.devices.profiles.choice import DeviceChoice
from regolithd.drivers.master.status import NodePhase

if TYPE_CHECKING:
    from pathlib import Path

_PDO_SECTIONS = re.compile(r"^\[1[468A]0[0-9A-F](sub[0-9A-F]+)?\]\n[^\[]*", re.MULTILINE)


def without(name: str, pattern: re.Pattern[str], added: str, folder: Path) -> Path:
    """Return a copy of an EDS file that comes with regolithd, without some sections, and with others at its end."""
    text, count = pattern.subn("", (EDS_FOLDER / name).read_text())
    assert count
    path = folder / name
    path.write_text(text + added)
    return path


async def test_a_drive_with_compact_pdos_boots_and_turns(tmp_path: Path) -> None:
    """The sections of its PDOs are those that `CompactPDO` stands for."""
    path = without("epos4.eds", _PDO_SECTIONS, "", tmp_path)
    text = re.sub(r"NrOf([RT])XPDO=\d+", r"NrOf\1XPDO=4", path.read_text())
    path.write_text(text.replace("Granularity=8\n", "Granularity=8\nCompactPDO=0x1F\n"))
    node = motor(DeviceChoice("epos4", path))
    async with rig([node]) as r:
        await r.network.settled()
        assert r.network.status[node.node_id].phase is NodePhase.OPERATIONAL, r.network.status[node.node_id].text
        await r.network.enable()
        await r.network.set_speed((0.0, 0.0, 0.1, 0.0, 0.0, 0.0))
        speed = 0.1 * r.network.settings.gear_ratio
        await until(lambda: r.latest(node.node_id, MOTOR_SPEED) == pytest.approx(speed, rel=0.01), "the drive turns")


async def test_an_amplifier_with_compact_arrays_boots_and_measures(tmp_path: Path) -> None:
    """Its third channel is one of four that `CompactSubObj` stands for."""
    arrays = re.compile(r"^\[(9130|6150|6131|6132)(sub[0-9A-F]+)?\]\n[^\[]*", re.MULTILINE | re.IGNORECASE)
    text = (EDS_FOLDER / "cia404.eds").read_text()
    added = ""
    for index in sorted({match[1] for match in arrays.finditer(text)}):
        (entry,) = re.findall(rf"^\[{index}sub1\]\n([^\[]*)", text, re.MULTILINE)
        kept = re.sub(r"ObjectType=.*\n", "", entry).strip()
        added += f"\n[{index}]\n{kept}\nObjectType=0x8\nCompactSubObj=4\n"
    path = without("cia404.eds", arrays, added, tmp_path)
    node = load_cell(DeviceChoice("cia404", path, 3))
    async with rig([node]) as r:
        await r.network.settled()
        assert r.network.status[node.node_id].phase is NodePhase.OPERATIONAL, r.network.status[node.node_id].text
        await until(lambda: r.latest(node.node_id, LOAD) == pytest.approx(53.0, abs=0.5), "the load is measured")
