"""Each injected fault has its effect on the bus, for its node only, and can be cleared."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import pytest
from virtual_master import LOAD_CELL_TPDO, MASTER_ID, MOTOR_TPDO, AbortedError, Master

from regolithd.drivers.virtual import Bench, Measurement
from regolithd.drivers.virtual.fault_injection import COMMANDS

if TYPE_CHECKING:
    import numpy as np


class Ticking(Bench):
    """A plant whose loads change continuously."""

    def measure(self, time_s: float, motor_speed_rad_s: np.ndarray) -> Measurement:
        """Return loads that grow."""
        measurement = super().measure(time_s, motor_speed_rad_s)
        measurement.load_N[:] += time_s
        return measurement


class Running(Master):
    """Two load cells and a drive, operational, with heartbeats of 100 ms."""

    def __init__(self) -> None:
        super().__init__(plant=Ticking())
        for node in (11, 12):
            self.configure(node, tpdo=LOAD_CELL_TPDO)
        self.configure(1, tpdo=MOTOR_TPDO)
        for node in (1, 11, 12):
            self.write(node, 0x1017, 0, 100, 2)
        self.nmt(1)

    def inject_fault(self, line: str) -> None:
        """Inject a fault; the command must be accepted."""
        assert self.rover.inject_fault(line) == "ok"

    def heartbeats(self, node: int) -> list[int]:
        """Return the states in a node's heartbeats of the next half second."""
        return [frame.data[0] for frame in self.wait(0.5) if frame.can_id == 0x700 + node]

    def load(self, node: int) -> int | None:
        """Return a load cell's answer to a SYNC a little later."""
        self.wait(0.02)
        data = self.sync().get(0x180 + node)
        return None if data is None else struct.unpack_from("<i", data)[0]

    def well(self, node: int) -> bool:
        """Whether a load cell works without a fault."""
        first, second = self.load(node), self.load(node)
        grows = first is not None and second is not None and second > first
        return grows and self.heartbeats(node).count(5) in {4, 5, 6}


@pytest.fixture
def running() -> Running:
    """Two load cells and a drive, operational."""
    master = Running()
    assert master.well(11)
    return master


def test_a_node_without_power_sends_nothing(running: Running) -> None:
    """After power-on it boots up, pre-operational and unconfigured."""
    running.inject_fault("off 11")
    assert running.load(11) is None
    assert running.heartbeats(11) == []
    assert running.send(0x60B, bytes(8)) == []
    assert running.well(12)
    running.inject_fault("on 11")
    assert [f.data for f in running.wait(0.1) if f.can_id == 0x70B] == [b"\0"]
    assert running.read(11, 0x1017) == 0
    running.nmt(1)
    assert running.load(11) is None


def test_an_emergency_is_sent_once_and_ends(running: Running) -> None:
    """EMCY has the error register, and error code 0 follows at its end."""
    running.inject_fault("emcy 12 0x5000")
    running.inject_fault("emcy 12 0x5000")
    running.inject_fault("emcy 12 0")
    frames = [f.data for f in running.wait(0.1) if f.can_id == 0x8C]
    assert frames == [struct.pack("<HB5s", 0x5000, 0x01, b""), bytes(8)]
    assert running.well(11)


def test_a_node_may_report_another_identity(running: Running) -> None:
    """Object 0x1018 has the injected value until it is cleared, after a reset as well."""
    was = running.read(4, 0x1018, 2)
    running.inject_fault("identity 4 product 0x999")
    assert running.read(4, 0x1018, 2) == 0x999
    running.nmt(0x81, 4)
    running.wait(0.1)
    assert running.read(4, 0x1018, 2) == 0x999
    running.inject_fault("clear 4")
    assert running.read(4, 0x1018, 2) == was


def test_a_silent_node_answers_sdo_and_sends_heartbeats(running: Running) -> None:
    """It sends no PDO."""
    running.inject_fault("silent 11")
    assert running.load(11) is None
    assert set(running.heartbeats(11)) == {5}
    assert running.read(11, 0x1000)
    assert running.well(12)


def test_a_frozen_node_repeats_its_values(running: Running) -> None:
    """Its value stays constant while the plant changes."""
    running.inject_fault("frozen 11")
    before = running.load(11)
    assert before is not None
    assert running.load(11) == before
    assert running.well(12)


def test_a_deaf_drive_ignores_rpdos(running: Running) -> None:
    """It reports no error either."""
    running.configure(2, tpdo=MOTOR_TPDO, rpdo=(0x60400010, 0x60FF0020))
    running.nmt(1, 2)
    running.inject_fault("deaf 2")
    running.send(0x202, struct.pack("<Hi", 0x06, 0))
    assert running.read(2, 0x6041) & 0x6F == 0x40


def test_a_slow_node_answers_later(running: Running) -> None:
    """Its PDO arrives after the given delay."""
    running.inject_fault("slow 11 30")
    assert running.load(11) is None
    assert [f for f in running.wait(0.02) if f.can_id == 0x18B] == []
    assert len([f for f in running.wait(0.02) if f.can_id == 0x18B]) == 1


def test_a_short_pdo_is_truncated(running: Running) -> None:
    """The last bytes are missing."""
    running.inject_fault("short 11 2")
    assert len(running.sync()[0x18B]) == 3


def test_status_bits_are_set(running: Running) -> None:
    """Bits of 0x6150 are set by command."""
    running.inject_fault("status 11 1")
    assert running.sync()[0x18B][4] == 1


def test_no_boot_up(running: Running) -> None:
    """After a reset the node sends nothing."""
    running.inject_fault("no-boot-up 11")
    running.nmt(0x81, 11)
    assert running.heartbeats(11) == []
    assert running.send(0x60B, bytes(8)) == []


def test_no_heartbeat_and_no_sdo(running: Running) -> None:
    """One node sends no heartbeat and another answers no SDO, and their PDOs continue."""
    running.inject_fault("no-heartbeat 11")
    running.inject_fault("no-sdo 12")
    assert running.heartbeats(11) == []
    assert running.send(0x60C, bytes(8)) == []
    assert running.load(11) is not None
    assert running.load(12) is not None


def test_writing_is_refused_or_has_no_effect(running: Running) -> None:
    """One object is aborted with a hardware error, another is acknowledged and keeps its value."""
    running.inject_fault("refuse 11 0x1017")
    with pytest.raises(AbortedError, match="0x06060000"):
        running.write(11, 0x1017, 0, 50, 2)
    running.inject_fault("forget 12 0x1017")
    running.write(12, 0x1017, 0, 50, 2)
    assert running.read(12, 0x1017) == 0


def test_a_spontaneous_reset(running: Running) -> None:
    """The node sends a boot-up message and has lost its configuration."""
    running.inject_fault("reset 11")
    assert [f.data for f in running.wait(0.1) if f.can_id == 0x70B] == [b"\0"]
    assert running.read(11, 0x1017) == 0


def test_leaving_operational(running: Running) -> None:
    """The heartbeat has the state pre-operational, and no PDO is sent."""
    running.inject_fault("leave 11")
    assert running.load(11) is None
    assert set(running.heartbeats(11)) == {0x7F}


def test_every_node_reports_the_loss_of_the_master(running: Running) -> None:
    """EMCY 0x8130 and pre-operational (0x1029) follow, and the error ends with the next heartbeat."""
    running.write(11, 0x1016, 1, MASTER_ID << 16 | 200, 4)
    running.heartbeat()
    frames = running.wait(0.3)
    assert [f.data for f in frames if f.can_id == 0x8B] == [struct.pack("<HB5s", 0x8130, 0x11, b"")]
    assert running.load(11) is None
    before = len(running.seen)
    running.heartbeat()
    assert [f.data for f in running.seen[before:] if f.can_id == 0x8B] == [bytes(8)]


FOR_A_MASTER_TO_MEND = {"off", "on", "reset", "leave", "no-boot-up", "fault"}


@pytest.mark.parametrize("name", [name for name in COMMANDS if name not in FOR_A_MASTER_TO_MEND])
def test_every_fault_can_be_cleared(running: Running, name: str) -> None:
    """The command `clear` ends each fault."""
    words = {"identity": "vendor 1", "emcy": "0x1000", "slow": "500", "short": "1", "status": "1"}
    words |= {"refuse": "0x1017", "forget": "0x1017"}
    running.inject_fault(f"{name} 11 {words.get(name, '')}")
    running.inject_fault("clear all")
    assert running.well(11)
    assert running.read(11, 0x1018, 1) == running.read(12, 0x1018, 1)


WRONG = ["bang 3", "off", "off 77", "off x", "identity 3", "identity 3 colour 1", "emcy 3", "fault 11 1", "refuse 3"]


@pytest.mark.parametrize("line", WRONG)
def test_a_wrong_command_is_refused_with_its_reason(running: Running, line: str) -> None:
    """It changes nothing."""
    assert running.rover.inject_fault(line).startswith("error: ")
    assert running.well(11)


def test_help_names_every_command(running: Running) -> None:
    """There is one line for each command."""
    lines = running.rover.inject_fault("help").splitlines()
    assert [line.split()[0] for line in lines] == list(COMMANDS)
