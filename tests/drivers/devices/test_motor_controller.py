"""The virtual drive turns, stops and faults as its object dictionary says."""

from __future__ import annotations

import struct

import pytest
from virtual_master import MASTER_ID, DriveUnderTest

from regolithd.drivers.canopen.emcy import error_text
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER


@pytest.mark.parametrize(
    ("code", "part"),
    [(0xFF01, "Hall sensor error"), (0xFF02, "encoder index"), (0xFF03, "resolution"), (0xFF04, "Hall sensor not")],
)
def test_a_sensor_s_error_is_told_by_its_own_text(code: int, part: str) -> None:
    """Codes of the EPOS's manufacturer, of which CiA 301 knows the class alone."""
    assert part in error_text(code, MOTOR_CONTROLLER.error_texts)


def test_it_follows_its_ramps() -> None:
    """Speed rises by 0x6083 and falls by 0x6084 [rpm/s], to the target and no further."""
    drive = DriveUnderTest()
    drive.master.write(1, 0x6083, 0, 1000, 4)
    drive.master.write(1, 0x6084, 0, 2000, 4)
    drive.enable()
    drive.send_controlword(0x0F, 1500)
    drive.master.wait(1)
    assert drive.speed_rpm == pytest.approx(1000, abs=25)
    assert not drive.statusword & 0x0400
    drive.master.wait(1)
    assert drive.speed_rpm == 1500
    assert drive.statusword & 0x0400  # target reached
    drive.send_controlword(0x0F, 500)
    drive.master.wait(0.25)
    assert drive.speed_rpm == pytest.approx(1000, abs=45)
    drive.send_controlword(0x0F, -500)
    drive.master.wait(2)
    assert drive.speed_rpm == -500


def test_it_turns_only_in_operation_enabled() -> None:
    """A target alone has no effect, halt stops the motor without leaving the state, and disabling stops it."""
    drive = DriveUnderTest()
    drive.send_controlword(0x06, 1000)
    drive.master.wait(1)
    assert drive.speed_rpm == 0
    drive.run_at(1000)
    assert drive.send_controlword(0x10F, 1000) == 0x27
    drive.master.wait(1)
    assert drive.speed_rpm == 0
    assert drive.statusword & 0x1000
    drive.send_controlword(0x0F, 1000)
    drive.master.wait(1)
    assert drive.speed_rpm == 1000
    assert drive.send_controlword(0x07, 1000) == 0x23
    drive.master.wait(1)
    assert drive.speed_rpm == 0


def test_the_speed_is_limited() -> None:
    """The speed does not exceed 0x607F."""
    drive = DriveUnderTest()
    drive.master.write(1, 0x607F, 0, 600, 4)
    drive.enable()
    drive.send_controlword(0x0F, 5000)
    drive.master.wait(2)
    assert drive.speed_rpm == 600


@pytest.mark.parametrize(
    ("option", "ramp", "after"),
    [(1, 1000, 0x40), (2, 4000, 0x40), (5, 1000, 0x07), (6, 4000, 0x07), (0, 50_000, 0x40)],
)
def test_quick_stop_follows_its_option_code(option: int, ramp: int, after: int) -> None:
    """Option code 0x605A selects the ramp, and whether transition 12 follows by itself."""
    drive = DriveUnderTest()
    drive.master.write(1, 0x6084, 0, 1000, 4)
    drive.master.write(1, 0x6085, 0, 4000, 4)
    drive.master.write(1, 0x605A, 0, option, 2)
    drive.run_at(3000)
    assert drive.send_controlword(0x02, 3000) == 0x07
    drive.master.wait(2900 / ramp)
    assert 0 < drive.speed_rpm <= 3000 or ramp == 50_000
    drive.master.wait(0.5)
    assert drive.speed_rpm == 0
    assert drive.state == after


def test_transition_16_leaves_a_holding_quick_stop() -> None:
    """It exists for option codes 5 and 6."""
    drive = DriveUnderTest()
    drive.master.write(1, 0x605A, 0, 6, 2)
    drive.run_at(1000)
    drive.send_controlword(0x02)
    drive.master.wait(1)
    assert drive.send_controlword(0x0F, 1000) == 0x27


def test_a_fault_stops_the_drive_and_lasts() -> None:
    """EMCY, 0x603F, 0x1001 and 0x1003 report it; fault follows the fault reaction, and a fault reset clears it."""
    drive = DriveUnderTest()
    drive.run_at(3000)
    master = drive.master
    master.rover.inject_fault("fault 1 0x2310")
    frames = master.wait(0.02)
    assert [f.data for f in frames if f.can_id == 0x81] == [struct.pack("<HB5s", 0x2310, 0x03, b"")]
    assert drive.state == 0x0F
    master.wait(1)
    assert drive.state == 0x08
    assert drive.speed_rpm == 0
    assert (master.read(1, 0x603F), master.read(1, 0x1001)) == (0x2310, 0x03)
    assert (master.read(1, 0x1003), master.read(1, 0x1003, 1)) == (1, 0x2310)
    before = len(master.seen)
    assert drive.send_controlword(0x80) == 0x40
    assert [f.data for f in master.seen[before:] if f.can_id == 0x81] == [bytes(8)]
    assert (master.read(1, 0x603F), master.read(1, 0x1001)) == (0, 0)


@pytest.mark.parametrize(("option", "state"), [(0, 0x27), (1, 0x08), (2, 0x40), (3, 0x40)])
def test_the_loss_of_the_masters_heartbeat_stops_it(option: int, state: int) -> None:
    """Heartbeat consumer (0x1016): EMCY 0x8130 and the reaction of 0x6007, only after the first heartbeat."""
    drive = DriveUnderTest()
    master = drive.master
    master.write(1, 0x6007, 0, option, 2)
    master.write(1, 0x1016, 1, MASTER_ID << 16 | 500, 4)
    drive.run_at(3000)  # two seconds without a first heartbeat: monitoring has not begun
    master.heartbeat()
    master.wait(0.49)
    assert drive.speed_rpm == 3000
    master.heartbeat()
    frames = master.wait(0.51)
    assert [f.data[:3] for f in frames if f.can_id == 0x81] == [struct.pack("<HB", 0x8130, 0x11)]
    master.wait(1)
    assert drive.state == state
    assert drive.speed_rpm == (3000 if option == 0 else 0)


def test_a_returning_master_does_not_restart_the_drive() -> None:
    """After the loss, a fault reset and all transitions to operation enabled are necessary."""
    drive = DriveUnderTest()
    drive.master.write(1, 0x1016, 1, MASTER_ID << 16 | 100, 4)
    drive.run_at(1000)
    drive.master.heartbeat()
    drive.master.wait(1)
    drive.master.heartbeat()
    drive.master.nmt(1)
    assert drive.send_controlword(0x0F, 1000) == 0x08
    assert drive.send_controlword(0x8F) == 0x40
    drive.enable()


def test_stopping_the_node_stops_the_motor() -> None:
    """The NMT command `stop` is a loss of the connection as well (CiA 402-2, 0x6007)."""
    drive = DriveUnderTest()
    drive.run_at(1000)
    drive.master.nmt(2)
    drive.master.wait(1)
    drive.master.nmt(1)
    assert drive.speed_rpm == 0
    assert drive.state == 0x08


def test_it_refuses_every_other_mode() -> None:
    """Only profile velocity (3) is supported, and 0x6061 keeps reporting it."""
    drive = DriveUnderTest()
    with pytest.raises(Exception, match="0x06090030"):
        drive.master.write(1, 0x6060, 0, 1, 1)
    drive.master.write(1, 0x6060, 0, 3, 1)
    assert drive.master.read(1, 0x6061) == 3


@pytest.mark.parametrize(
    ("option", "state", "ramp"),
    [(0, 0x27, 0), (1, 0x0F, 4000), (2, 0x40, 50_000), (3, 0x07, 4000)],
    ids=["no action", "fault", "disable voltage", "quick stop"],
)
def test_the_loss_of_the_connection_selects_state_and_ramp(option: int, state: int, ramp: int) -> None:
    """Option code 0x6007 determines the state in the statusword, at once, and the deceleration [rpm/s]."""
    drive = DriveUnderTest()
    drive.master.write(1, 0x6085, 0, 4000, 4)
    drive.master.write(1, 0x6007, 0, option, 2)
    drive.run_at(3000)
    device = drive.master.node(1).device
    device.connection_lost()
    assert drive.state == state
    device.advance(0.05)
    assert drive.speed_rpm == 3000 - 0.05 * ramp


def test_a_disabled_drive_stays_disabled_when_the_connection_is_lost() -> None:
    """Neither disable voltage nor quick stop applies to a drive in switch-on disabled."""
    for option in (2, 3):
        drive = DriveUnderTest()
        drive.master.write(1, 0x6007, 0, option, 2)
        drive.master.node(1).device.connection_lost()
        assert drive.state == 0x40


def test_averaged_current_and_velocity_follow_the_measured_ones() -> None:
    """Objects 0x2027 (current) and 0x2028 (velocity) converge with a time constant of 50 ms."""
    drive = DriveUnderTest()
    drive.master.write(1, 0x6083, 0, 10_000, 4)
    drive.run_at(1000)
    drive.master.wait(1)
    assert drive.master.read(1, 0x2027) == 40
    assert drive.master.read(1, 0x2028) == 1000
    drive.send_controlword(0x0F, 2000)
    drive.master.wait(0.11)
    assert drive.speed_rpm == 2000
    assert 1500 < drive.master.read(1, 0x2028) < 1900
    drive.master.wait(1)
    assert drive.master.read(1, 0x2028) == 2000
