"""The virtual nodes' PDOs: content and transmission follow the configuration."""

from __future__ import annotations

import math
import struct
from dataclasses import replace

import numpy as np
import pytest
from virtual_master import LOAD_CELL_TPDO, MOTOR_TPDO, AbortedError, DriveUnderTest, Master

from regolithd.drivers.virtual import Bench, Measurement
from regolithd.drivers.virtual.pdo import EnabledPdo, usable


class Tilted(Bench):
    """A plant with a slope, and loads that depend on time."""

    def measure(self, time_s: float, motor_speed_rad_s: np.ndarray) -> Measurement:
        """Return the bench's values on a slope."""
        bench = super().measure(time_s, motor_speed_rad_s)
        return replace(
            bench,
            load_N=bench.load_N + time_s,
            pitch_rad=math.radians(1.25),
            roll_rad=math.radians(-2.5),
            yaw_rate_rad_s=math.radians(-0.75),
            ground_speed_m_s=-0.021,
            hub_speed_m_s=0.01 * np.arange(1.0, 7.0),
        )


def test_an_unconfigured_node_sends_nothing() -> None:
    """Operational or not, it answers no SYNC before a PDO is configured."""
    master = Master()
    assert master.sync() == {}
    master.nmt(1)
    assert master.sync() == {}


@pytest.mark.parametrize(
    ("what", "index", "sub", "value", "size"),
    [
        ("left disabled", 0x1800, 1, 0x8000_0181, 4),
        ("another SYNC", 0x1005, 0, 0x81, 4),
        ("event-driven, and nothing changes", 0x1800, 2, 255, 1),
    ],
)
def test_a_wrongly_configured_node_sends_nothing(what: str, index: int, sub: int, value: int, size: int) -> None:
    """One wrong object of the configuration is enough."""
    master = Master()
    master.configure(1, tpdo=MOTOR_TPDO)
    master.nmt(1)
    assert list(master.sync()) == [0x181]
    master.write(1, index, sub, value, size)
    master.wait(0.5)
    assert master.sync() == {}, what


def test_only_an_operational_node_sends() -> None:
    """No PDO is sent before the NMT command start, after stop, or in pre-operational."""
    master = Master()
    master.configure(1, tpdo=MOTOR_TPDO)
    assert master.sync() == {}
    for command, talks in ((1, True), (2, False), (1, True), (0x80, False)):
        master.nmt(command, 1)
        assert bool(master.sync()) is talks


def test_a_pdo_has_the_mapped_objects_in_their_order() -> None:
    """Two mappings of the same node, with another COB-ID, are exact to the byte."""
    master = Master()
    master.configure(3, tpdo=MOTOR_TPDO)
    master.nmt(1)
    assert master.sync() == {0x183: struct.pack("<Hhi", 0x1640, 0, 0)}
    master.write(3, 0x1800, 1, 0x8000_0183, 4)
    master.configure(3, tpdo=(0x2F000010, 0x60790020))
    assert master.sync() == {0x183: struct.pack("<hI", 202, 24000)}


def test_transmission_types() -> None:
    """Type 1 sends at every SYNC, type 3 at every third, type 0 at a SYNC after a change."""
    for kind, expected in ((1, 6), (3, 2), (0, 1)):
        master = Master()
        master.configure(11, tpdo=LOAD_CELL_TPDO, kind=kind)
        master.nmt(1)
        assert sum(len(master.sync()) for _ in range(6)) == expected


def test_an_event_timer_sends_without_sync() -> None:
    """With type 255 and 0x1800:05 = 100 ms, ten PDOs a second are sent."""
    master = Master()
    master.configure(11, tpdo=LOAD_CELL_TPDO, kind=255)
    master.write(11, 0x1800, 5, 100, 2)
    master.nmt(1)
    assert sum(frame.can_id == 0x18B for frame in master.wait(1.001)) in {10, 11}


def test_every_sensor_reports_the_plants_values() -> None:
    """Each value has the device's unit and position, and all are of the SYNC's instant."""
    master = Master(plant=Tilted())
    for wheel in range(6):
        master.configure(11 + wheel, tpdo=LOAD_CELL_TPDO)
    master.configure(21, tpdo=(0x60100010, 0x60200010, 0x20100010))
    master.configure(22, tpdo=(0x21000020, 0x21010620))
    master.nmt(1)
    master.wait(0.4)
    pdos = master.sync()
    time_s = (struct.unpack("<iB", pdos[0x18B])[0] - 5000) / 100
    assert time_s == pytest.approx(0.5, abs=0.011)
    for wheel in range(6):
        assert struct.unpack("<iB", pdos[0x18B + wheel])[0] == round(100 * (50 + wheel + time_s))
    assert struct.unpack("<hhh", pdos[0x195]) == (125, -250, -75)
    assert struct.unpack("<ii", pdos[0x196]) == (-2100, 6000)


def test_a_synchronous_rpdo_waits_for_the_sync() -> None:
    """Type 1 takes effect at the next SYNC, type 255 at once."""
    drive = DriveUnderTest()
    assert drive.send_controlword(0x06) == 0x21
    drive.master.write(1, 0x1400, 2, 1, 1)
    assert drive.send_controlword(0x07) == 0x21
    drive.master.sync()
    assert drive.state == 0x23


@pytest.mark.parametrize(("length", "code", "obeyed"), [(5, 0x8210, False), (7, 0x8220, True)])
def test_an_rpdo_of_the_wrong_length_is_reported(length: int, code: int, *, obeyed: bool) -> None:
    """Too short: EMCY 0x8210 and no effect; too long: EMCY 0x8220, and the mapped objects are written."""
    drive = DriveUnderTest()
    frames = drive.master.send(0x201, struct.pack("<Hi", 0x06, 0).ljust(8, b"\0")[:length])
    assert [struct.unpack_from("<H", f.data)[0] for f in frames if f.can_id == 0x81] == [code]
    assert (drive.state == 0x21) is obeyed


@pytest.mark.parametrize(("load", "status"), [(50.0, 0), (250.0, 2), (-1.0, 4), (math.nan, 1)])
def test_a_load_cell_reports_overload_and_invalid_values(load: float, status: int) -> None:
    """Object 0x6150 has not valid, positive and negative overload (CiA 404)."""

    class Overloaded(Bench):
        def measure(self, time_s: float, motor_speed_rad_s: np.ndarray) -> Measurement:
            return replace(super().measure(time_s, motor_speed_rad_s), load_N=np.full(6, load))

    master = Master(plant=Overloaded())
    master.configure(11, tpdo=LOAD_CELL_TPDO)
    master.nmt(1)
    assert master.sync()[0x18B][4] == status


def test_transmission_types_up_to_240_are_synchronous() -> None:
    """CiA 301, 7.5.2.35: 0 to 240 are synchronous, 254 and 255 event-driven."""
    synchronous = [
        kind for kind in (0, 1, 240, 254, 255) if EnabledPdo(0x181, kind, (), struct.Struct("<")).synchronous
    ]
    assert synchronous == [0, 1, 240]


def test_an_enabled_pdo_may_be_written_again_and_a_disabled_one_moved() -> None:
    """Only another identifier for an enabled PDO is refused; its transmission type and event time may change."""
    master = Master()
    master.configure(11, tpdo=LOAD_CELL_TPDO)
    master.write(11, 0x1800, 1, 0x18B, 4)
    master.write(11, 0x1800, 2, 1, 1)
    master.write(11, 0x1800, 5, 100, 2)
    with pytest.raises(AbortedError, match="0x06090030"):
        master.write(11, 0x1800, 3, 100, 2)  # CiA 301: the inhibit time, while it is enabled
    master.write(11, 0x1800, 1, 0x8000_018B, 4)
    master.write(11, 0x1800, 3, 100, 2)
    master.write(11, 0x1800, 1, 0x20B, 4)
    assert master.read(11, 0x1800, 1) == 0x20B


RESTRICTED = [
    (0x000, 0x000),  # NMT
    (0x001, 0x07F),
    (0x080, 0x080),  # SYNC
    (0x101, 0x180),
    (0x581, 0x5FF),  # SDO, server to client
    (0x601, 0x67F),  # SDO, client to server
    (0x6E0, 0x6FF),
    (0x701, 0x77F),  # heartbeats
    (0x780, 0x7FF),
]
"""CiA 301, table 39; 0x700 and what lies between them are left to PDOs there, here not."""


def test_a_pdo_has_none_of_the_restricted_identifiers() -> None:
    """Of all 2048; whether bit 31 disables it does not matter, and a 29-bit identifier is none of this node's."""
    restricted = {number for first, last in RESTRICTED for number in range(first, last + 1)} | {0x700}
    assert {number for number in range(0x800) if not usable(number)} == restricted
    assert usable(0x8000_0181)
    assert not usable(0x8000_0080)
    assert not usable(0x2000_0181)
