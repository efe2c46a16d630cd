"""The master of one motor controller, and of all, against objects that answer at once."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import TYPE_CHECKING

import pytest

from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.errors import BusDownError, DriveError, SdoAbortError, SdoTimeoutError
from regolithd.drivers.master import drive as drive_module
from regolithd.drivers.master.cia402 import DriveState, at_standstill, target_reached
from regolithd.drivers.master.drive import Drive
from regolithd.drivers.master.motion import Motion, each
from regolithd.drivers.master.status import NodePhase, NodeStatus

if TYPE_CHECKING:
    from regolithd.drivers.can.frame import Frame

ENABLED, QUICK_STOP, SWITCH_ON_DISABLED, FAULT = 0x0637, 0x0217, 0x0250, 0x0218
STANDING = 0x1000


class Bus:
    """A bus that keeps what is sent, or refuses everything."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.down = False

    async def send(self, frame: Frame) -> None:
        """Keep a frame."""
        if self.down:
            raise BusDownError("vcan0: cannot send")
        self.frames.append(frame)


class Objects:
    """The objects of one drive, as its SDO client reads and writes them; statuswords come in turn, the last stays."""

    def __init__(self, *statuswords: int, mode: int = 3, error_code: int = 0, limit: int | None = None) -> None:
        self.statuswords = list(statuswords)
        self.values = {0x6061: mode, 0x603F: error_code, 0x607F: limit}
        self.writes: list[tuple[int, bytes]] = []

    async def read_number(self, index: int, subindex: int = 0, *, signed: bool = False) -> int:
        """Return an object's value."""
        assert subindex == 0
        assert signed == (index == 0x6061)
        if index == 0x6041:
            return self.statuswords.pop(0) if len(self.statuswords) > 1 else self.statuswords[0]
        value = self.values[index]
        if value is None:
            raise SdoAbortError(0x06020000, "object does not exist", node_id=4, index=index, subindex=0)
        return value

    async def write(self, index: int, subindex: int, data: bytes) -> None:
        """Keep what is written."""
        assert subindex == 0
        self.writes.append((index, data))


def drive_of(objects: Objects, bus: Bus, *, node_id: int = 4, wheel: int | None = 3, mirrored: bool = False) -> Drive:
    """Return the master of a drive with these objects."""
    node = NodeDescription(node_id, MOTOR_CONTROLLER, wheel, mirrored=mirrored)
    return Drive(bus, SimpleNamespace(node=node, sdo=objects, factor=float))


@pytest.fixture(autouse=True)
def _short_timeouts(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("_ENABLE_TIMEOUT_S", 0.05), ("_STOP_TIMEOUT_S", 0.06), ("_RESEND_S", 0.02), ("_POLL_S", 0.0)):
        monkeypatch.setattr(drive_module, name, value)


async def test_enabling_writes_speed_zero_and_then_the_controlwords_in_order() -> None:
    """Target velocity 0 comes first, then bit 7 at 0, shutdown, switch on, enable operation."""
    objects = Objects(SWITCH_ON_DISABLED, 0x0231, 0x0233, ENABLED)
    drive = drive_of(objects, Bus())
    assert drive.state is DriveState.UNKNOWN
    await drive.enable()
    assert objects.writes == [
        (0x60FF, bytes(4)),
        (0x6040, b"\x00\x00"),
        (0x6040, b"\x06\x00"),
        (0x6040, b"\x07\x00"),
        (0x6040, b"\x0f\x00"),
    ]
    assert drive.state is DriveState.ENABLED


async def test_a_drive_in_another_mode_is_not_enabled() -> None:
    """Nothing is written to a drive that is not in profile velocity mode."""
    objects = Objects(ENABLED, mode=-1)
    with pytest.raises(DriveError, match=r"node 4: is in mode -1 instead of profile velocity mode \(3\)\. Boot"):
        await drive_of(objects, Bus()).enable()
    assert objects.writes == []


async def test_a_drive_that_stays_in_fault_is_named_with_its_error_code() -> None:
    """After the timeout the error code (0x603F) is read; meanwhile bit 7 alternates."""
    objects = Objects(FAULT, error_code=0x3220)
    with pytest.raises(DriveError, match=r"^node 4: stays in fault, error code 0x3220: undervoltage: .*\. See its em"):
        await drive_of(objects, Bus()).enable()
    assert [data for _, data in objects.writes[1:4]] == [b"\x00\x00", b"\x80\x00", b"\x00\x00"]


@pytest.mark.parametrize(
    ("history", "said"),
    [({(0x1003, 1): 0x0001_2310}, r", error code 0x2310: "), ({}, r"; it has no object that holds")],
)
async def test_a_drive_without_an_error_code_object_is_still_named(
    history: dict[tuple[int, int], int], said: str
) -> None:
    """0x603F is optional: the newest entry of 0x1003 counts, or none, and the fault is said in any case."""

    class WithoutErrorCode(Objects):
        async def read_number(self, index: int, subindex: int = 0, *, signed: bool = False) -> int:
            if index == 0x603F or (index == 0x1003 and (index, subindex) not in history):
                raise SdoAbortError(0x06020000, "no such object", node_id=4, index=index, subindex=subindex)
            return history.get((index, subindex)) or await super().read_number(index, subindex, signed=signed)

    with pytest.raises(DriveError, match=rf"^node 4: stays in fault{said}"):
        await drive_of(WithoutErrorCode(FAULT), Bus()).enable()


async def test_a_drive_that_does_not_enable_is_named_with_its_state() -> None:
    """After the timeout the message has the state that it stays in."""
    with pytest.raises(DriveError, match=r"node 4: is still in switch-on-disabled after 0\.05 s"):
        await drive_of(Objects(SWITCH_ON_DISABLED), Bus()).enable()


@pytest.mark.parametrize(("mirrored", "rpm"), [(False, 3820), (True, -3820)])
async def test_the_target_velocity_is_in_rpm_and_inverted_for_a_mirrored_motor(mirrored: bool, rpm: int) -> None:
    """400 rad/s at the motor is 3820 rpm, in one RPDO with the controlword 'enable operation'."""
    bus = Bus()
    await drive_of(Objects(ENABLED), bus, mirrored=mirrored).turn(400.0)
    (frame,) = bus.frames
    assert (frame.can_id, frame.data) == (0x204, b"\x0f\x00" + rpm.to_bytes(4, "little", signed=True))


async def test_a_quick_stop_is_one_frame_with_speed_zero() -> None:
    """Controlword 0x0002 and target velocity 0."""
    bus = Bus()
    await drive_of(Objects(ENABLED), bus).send_quick_stop()
    assert [(frame.can_id, frame.data) for frame in bus.frames] == [(0x204, b"\x02\0\0\0\0\0")]


@pytest.mark.parametrize("statusword", [SWITCH_ON_DISABLED, 0x0231, 0x0233, FAULT, QUICK_STOP | STANDING])
async def test_a_drive_that_is_off_or_holds_at_standstill_has_stopped(statusword: int) -> None:
    """Nothing is repeated by SDO for a drive that the quick stop has reached."""
    objects = Objects(ENABLED, QUICK_STOP, statusword)
    await drive_of(objects, Bus()).until_stopped()
    assert objects.writes == []


async def test_a_quick_stop_without_effect_is_repeated_by_sdo_and_then_an_error() -> None:
    """The SDO is tried after 0.02 s here, and after the timeout the remedy is to cut the supply."""
    objects = Objects(ENABLED)
    with pytest.raises(DriveError, match=r"node 4: does not stop: it is in operation-enabled\. Cut the motors' supply"):
        await drive_of(objects, Bus()).until_stopped()
    assert (0x6040, b"\x02\x00") in objects.writes


async def test_a_drive_that_still_brakes_is_waited_for() -> None:
    """Quick stop active without the standstill bit is not yet stopped, and is not repeated."""
    objects = Objects(QUICK_STOP)
    with pytest.raises(DriveError, match="does not stop: it is in quick-stop-active"):
        await drive_of(objects, Bus()).until_stopped()
    assert objects.writes == []


async def test_a_lost_drive_is_unknown() -> None:
    """A statusword by TPDO sets state and reported state, and forgetting it resets both."""
    drive = drive_of(Objects(ENABLED), Bus())
    assert drive.reported is DriveState.UNKNOWN
    assert drive.take_statusword(ENABLED) is DriveState.ENABLED
    assert (drive.state, drive.reported) == (DriveState.ENABLED, DriveState.ENABLED)
    drive.forget()
    assert (drive.statusword, drive.state, drive.reported) == (None, DriveState.UNKNOWN, DriveState.UNKNOWN)


@pytest.mark.parametrize("bit", range(16))
def test_a_statusword_bit_has_one_meaning(bit: int) -> None:
    """Bit 10 is 'target reached' and bit 12 'speed is 0' (CiA 402-2, profile velocity mode)."""
    assert target_reached(1 << bit) == (bit == 10)
    assert at_standstill(1 << bit) == (bit == 12)


class Rover:
    """Drives 1 and 2 on wheels 0 and 1, and a third motor without a wheel."""

    def __init__(self, *statuswords: int) -> None:
        self.bus = Bus()
        self.objects = {node_id: Objects(*statuswords) for node_id in (1, 2, 3)}
        wheels = {1: 0, 2: 1, 3: None}
        self.drives = {
            node_id: drive_of(objects, self.bus, node_id=node_id, wheel=wheels[node_id])
            for node_id, objects in self.objects.items()
        }
        self.phases = dict.fromkeys((1, 2, 3), NodePhase.OPERATIONAL)
        self.motion = Motion(self.drives, self.status, gear_ratio=100.0)

    def status(self, node_id: int) -> NodeStatus:
        """Return the status of a node."""
        return NodeStatus(self.drives[node_id].remote.node, phase=self.phases[node_id], text="it is off")


async def test_speeds_are_refused_before_the_wheels_are_enabled() -> None:
    """The message says why the wheels are locked, and what to do."""
    with pytest.raises(DriveError, match=r"^the wheels are locked: they have not been enabled yet\. Enable them$"):
        await Rover(ENABLED).motion.set_speed((0.1, 0.2))


async def test_a_wheel_speed_is_multiplied_by_the_gear_ratio() -> None:
    """Each wheel gets its own speed, and a motor without a wheel gets none."""
    rover = Rover(ENABLED)
    await rover.motion.enable()
    await rover.motion.set_speed((rad_s(10) / 100, rad_s(-20) / 100))
    assert [(frame.can_id, int.from_bytes(frame.data[2:], "little", signed=True)) for frame in rover.bus.frames] == [
        (0x201, 10),
        (0x202, -20),
    ]
    assert rover.motion.moving
    await rover.motion.set_speed((0.0, 0.0))
    assert not rover.motion.moving


async def test_a_speed_that_a_drive_does_not_reach_is_refused_before_anything_is_sent() -> None:
    """Its object 0x607F counts, where it has one and it is not 0; the drives are named, with the highest speeds."""
    rover = Rover(ENABLED)
    rover.objects[1].values[0x607F] = 0
    rover.objects[2].values[0x607F] = 600
    await rover.motion.enable()
    await rover.motion.set_speed((rad_s(9000) / 100, rad_s(-600) / 100))
    assert len(rover.bus.frames) == 2
    too_fast = r"turn at 94\.2 rad/s, more than object 0x607F allows \(node 2 62\.8 rad/s\)\. Choose at most 66 % of"
    with pytest.raises(DriveError, match=too_fast):
        await rover.motion.set_speed((rad_s(900) / 100, rad_s(-900) / 100))
    assert len(rover.bus.frames) == 2


def rad_s(rpm: float) -> float:
    """Return a speed in rad/s."""
    return rpm * math.pi / 30


async def test_a_speed_that_cannot_be_sent_stops_and_locks_all_wheels() -> None:
    """The bus error is raised, and the next speed is refused with the reason."""
    rover = Rover(ENABLED)
    await rover.motion.enable()
    rover.bus.down = True
    with pytest.raises(BusDownError):
        await rover.motion.set_speed((0.1, 0.1))
    assert not rover.motion.moving
    with pytest.raises(DriveError, match="locked: a command could not be sent to all of them"):
        await rover.motion.set_speed((0.1, 0.1))


async def test_a_missing_drive_is_named_and_nothing_is_enabled() -> None:
    """Phase and text of its status are in the message."""
    rover = Rover(ENABLED)
    rover.phases[2] = NodePhase.LOST
    with pytest.raises(DriveError, match=r"^node 2: the drive is not operational \(lost\)\. it is off$"):
        await rover.motion.enable()
    assert [objects.writes for objects in rover.objects.values()] == [[], [], []]
    assert [drive.node_id for drive in rover.motion.live()] == [1, 3]


async def test_a_drive_that_is_lost_or_disabled_after_enabling_is_named() -> None:
    """A speed needs every drive operational and enabled."""
    rover = Rover(ENABLED)
    await rover.motion.enable()
    rover.phases[2] = NodePhase.FAILED
    with pytest.raises(DriveError, match=r"^node 2: the drive is not operational$"):
        await rover.motion.set_speed((0.1, 0.1))
    rover.phases[2] = NodePhase.OPERATIONAL
    rover.drives[2].statusword = FAULT
    with pytest.raises(DriveError, match=r"^node 2: the drive is in fault\. Enable it first$"):
        await rover.motion.set_speed((0.1, 0.1))
    assert rover.bus.frames == []


async def test_where_one_drive_does_not_enable_all_are_disabled() -> None:
    """The error names the drive; the wheels stay locked."""
    rover = Rover(ENABLED)
    rover.objects[2].statuswords = [SWITCH_ON_DISABLED]
    with pytest.raises(DriveError, match="node 2: is still in switch-on-disabled"):
        await rover.motion.enable()
    assert [objects.writes[-1] for objects in rover.objects.values()] == [(0x6040, b"\0\0")] * 3
    with pytest.raises(DriveError, match="locked: they have not been enabled yet"):
        await rover.motion.set_speed((0.0, 0.0))


async def test_a_quick_stop_locks_the_wheels_with_its_reason() -> None:
    """Every drive gets the frame; drives that do not stop are named together."""
    rover = Rover(SWITCH_ON_DISABLED)
    await rover.motion.quick_stop()
    assert [frame.can_id for frame in rover.bus.frames] == [0x201, 0x202, 0x203]
    with pytest.raises(DriveError, match="locked: a quick stop was commanded"):
        await rover.motion.set_speed((0.1, 0.1))
    for node_id in (1, 3):
        rover.objects[node_id].statuswords = [QUICK_STOP]
    with pytest.raises(DriveError, match=r"^node 1: does not stop: .*; node 3: does not stop: "):
        await rover.motion.quick_stop("of a test")
    with pytest.raises(DriveError, match="locked: of a test"):
        await rover.motion.set_speed((0.1, 0.1))


@pytest.mark.parametrize("statusword", [ENABLED, SWITCH_ON_DISABLED])
async def test_disabling_stops_a_drive_only_where_one_is_enabled(statusword: int) -> None:
    """Drives that are off get no quick stop; either way their voltage is disabled, and the wheels are locked."""
    rover = Rover(statusword)
    for drive in rover.drives.values():
        await drive.read_state()
    for objects in rover.objects.values():
        objects.statuswords = [SWITCH_ON_DISABLED]
    await rover.motion.disable()
    assert len(rover.bus.frames) == (3 if statusword == ENABLED else 0)
    assert [objects.writes for objects in rover.objects.values()] == [[(0x6040, b"\0\0")]] * 3
    with pytest.raises(DriveError, match="locked: they are disabled"):
        await rover.motion.set_speed((0.1, 0.1))


async def test_only_errors_of_the_drivers_are_collected() -> None:
    """Every action is run to its end, and an error that is a bug is raised."""

    async def fine() -> None:
        return

    async def fails() -> None:
        raise SdoTimeoutError("no answer", node_id=2)

    async def is_wrong() -> None:
        raise ValueError

    assert await each([]) == []
    assert [str(error) for error in await each([fine(), fails(), fine(), fails()])] == ["node 2: no answer"] * 2
    with pytest.raises(ValueError, match=r"^$"):
        await each([fails(), is_wrong()])
