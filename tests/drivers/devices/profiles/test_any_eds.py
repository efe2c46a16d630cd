"""Any EDS file: real ones, damaged ones and random ones give a device, or sentences; never another error."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import numpy as np
import pytest
from described import makers
from hypothesis import given, settings
from hypothesis import strategies as st

from regolithd.daemon.config.reader import device_problems
from regolithd.drivers.canopen.object_dictionary import object_dictionary
from regolithd.drivers.devices.decoding.decoder import Decoder
from regolithd.drivers.devices.eds import EDS_FOLDER
from regolithd.drivers.devices.load_cell import LOAD_CELL
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.devices.profiles.choice import DeviceChoice
from regolithd.drivers.devices.profiles.compose import compose
from regolithd.drivers.devices.profiles.shipped import profiles
from regolithd.drivers.virtual.plant import Measurement
from regolithd.drivers.virtual.rover import VirtualRover

if TYPE_CHECKING:
    from pathlib import Path

SHEETS = sorted(EDS_FOLDER.glob("*.eds")) + [choice.eds for choice in makers().values() if choice.eds]
VALUES = (
    "",
    "0x",
    "rw",
    "ro",
    "const",
    "wo",
    "0x0",
    "0x7",
    "0x1F",
    "255",
    "-1",
    "$NODEID+0x180",
    "1e9",
    "ü",
    "0xFFFFFFFF",
)


class Still:
    """A plant without motion."""

    def measure(self, time_s: float, motor_speed_rad_s: object) -> Measurement:
        """Return constant values."""
        del time_s, motor_speed_rad_s
        return Measurement(motor_current_A=np.full(6, 0.05), load_N=np.full(6, 50.0))


def use(path: Path) -> list[str]:
    """Describe motors and load cells by this file with every profile; where that works, run a virtual node."""
    object_dictionary.cache_clear()
    said = []
    for kind, node in ((MOTOR_CONTROLLER, 3), (LOAD_CELL, 14)):
        for profile in profiles(kind):
            choice = DeviceChoice(profile.name, path)
            problems = list(device_problems(NodeDescription(node, kind, 2), choice))
            said += [str(problem) for problem in problems]
            device, _ = compose(kind, choice)
            if problems or device is None:
                continue
            described = NodeDescription(node, device, 2)
            Decoder([described])
            rover = VirtualRover(Still(), [described])
            rover.power_on(0)
            for now in range(0, 10**9, 10**8):
                rover.tick(now)
    compose.cache_clear()
    return said


@pytest.mark.parametrize("path", SHEETS, ids=lambda path: path.name)
def test_a_whole_file_gives_devices_or_sentences_with_a_cure(path: Path) -> None:
    """Each problem is a sentence of more than one clause: what is missing, and what to do."""
    for text in use(path):
        assert ". " in text, text


@pytest.mark.parametrize("entry", ["1400sub1", "1800sub1", "1800sub2", "1A00sub0"])
def test_a_record_of_a_pdo_without_a_mandatory_entry_is_no_pdo(entry: str, tmp_path: Path) -> None:
    """COB-ID, transmission type, and number of mapped objects (CiA 301): a device uses its other PDOs."""
    before, _, rest = (EDS_FOLDER / "cia402.eds").read_text().partition(f"[{entry}]")
    assert rest
    (tmp_path / "lacking.eds").write_text(before + rest[rest.index("\n[") + 1 :])
    for text in use(tmp_path / "lacking.eds"):
        assert ". " in text, text


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32), sheet=st.integers(0, len(SHEETS) - 1))
def test_a_damaged_file_gives_devices_or_sentences(
    tmp_path_factory: pytest.TempPathFactory, seed: int, sheet: int
) -> None:
    """Lines that are lost, doubled, cut or changed in value cause no other error."""
    chance = random.Random(seed)
    lines = SHEETS[sheet].read_text(errors="replace").splitlines()
    for _ in range(chance.randint(1, 12)):
        place = chance.randrange(len(lines))
        kind = chance.randrange(5)
        if kind == 0:
            del lines[place : place + chance.randint(1, 8)]
        elif kind == 1:
            lines.insert(place, lines[chance.randrange(len(lines))])
        elif kind == 2:
            lines[place] = lines[place][: chance.randint(0, 8)]
        else:
            lines[place] = f"{lines[place].partition('=')[0]}={chance.choice(VALUES)}"
        lines = lines or [""]
    path = tmp_path_factory.mktemp("eds") / "damaged.eds"
    path.write_text("\n".join(lines))
    use(path)


@settings(max_examples=40)
@given(content=st.binary(max_size=400))
def test_no_file_is_too_strange(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    """Bytes that are no EDS at all give a sentence."""
    path = tmp_path_factory.mktemp("eds") / "random.eds"
    path.write_bytes(content)
    assert use(path)
