"""Brakes of a mixed bench: CiA 402 drives in torque mode that load real motors with the torque of the virtual soil.

    virtual soil ▸ wheel torque [N·m] ▸ gear ▸ per mille of the rated torque (0x6076) ▸ target torque (0x6071)

| object | use |
|---|---|
| 0x6502 | chooses mode 4, profile torque, or else 10, cyclic synchronous torque; absent: mode 4 |
| 0x6060, 0x6061 | the mode, written before enabling and compared after it |
| 0x6076, 0x6072 | rated torque [mN·m]; largest torque [per mille of it], at most 1000 where it is absent or higher |
| 0x1016, 0x6007 | without the heartbeat of a virtual node of this bench, voltage is disabled; each may be absent |

Everything goes by SDO, so that the brake needs no PDO and no NMT state of its own. The target is 0 while the PDOs of
the wheel's motor are missing, and when the bench ends; the voltage is then disabled. A fault ends the braking until the
bench is started again. After a reset of the brake, it is configured and enabled anew.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from regolithd.drivers.canopen import cob_id
from regolithd.drivers.canopen.sdo_client import SdoClient
from regolithd.drivers.devices.decoding.decoder import Decoder
from regolithd.drivers.devices.decoding.signals import Reading
from regolithd.drivers.devices.motor_controller import MOTOR_SPEED
from regolithd.drivers.errors import DriveError, DriverError, SdoAbortError
from regolithd.drivers.master.cia402 import Controlword, DriveState, enabling_step, state_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from regolithd.drivers.can.bus import Bus
    from regolithd.drivers.can.frame import Frame
    from regolithd.drivers.devices.node import NodeDescription
    from regolithd.drivers.virtual.plant import Array

PERIOD_S = 0.1
"""Pause between two writes of the target torque."""
RETRY_S = 2.0
"""Pause before a brake that does not answer, or was reset, is configured again."""
SDO_TIMEOUT_S = 1.0
RATED_PERMILLE = 1000
TORQUE_MODES = ((4, 1 << 3), (10, 1 << 9))
"""Value of 0x6060, and bit of 0x6502: profile torque, cyclic synchronous torque."""

_DEVICE_TYPE, _DRIVE = 0x1000, 402
_HEARTBEAT_CONSUMER, _ABORT_CONNECTION, _DISABLE_VOLTAGE = 0x1016, 0x6007, 2
_ERROR_CODE, _CONTROLWORD, _STATUSWORD, _MODE, _MODE_DISPLAY = 0x603F, 0x6040, 0x6041, 0x6060, 0x6061
_TARGET_TORQUE, _MAX_TORQUE, _RATED_TORQUE, _SUPPORTED_MODES = 0x6071, 0x6072, 0x6076, 0x6502
_ABSENT = frozenset({0x06020000, 0x06090011})  # abort codes of an object, or sub-index, that is not there


@dataclass(frozen=True, slots=True)
class BrakeDescription:
    """A brake: its node-ID, its wheel (0–5), its turns per wheel turn, and whether it turns the other way."""

    node_id: int
    wheel: int
    gear_ratio: float = 1.0
    mirrored: bool = False

    def target_permille(self, wheel_torque_Nm: float, rated_Nm: float, limit_permille: int = RATED_PERMILLE) -> int:
        """Return the target torque [per mille of `rated_Nm`] that opposes a wheel's torque; 0 where that is NaN.

        Positive wheel torque drives the rover forward. The gear between brake and wheel is taken as free of loss.
        """
        if not math.isfinite(wheel_torque_Nm):
            return 0
        direction = 1 if self.mirrored else -1
        wanted = direction * RATED_PERMILLE * wheel_torque_Nm / (self.gear_ratio * rated_Nm)
        return round(min(max(wanted, -limit_permille), limit_permille))


@dataclass(frozen=True, slots=True)
class HeartbeatWatch:
    """The heartbeat that the brakes consume: of a virtual node of this bench, and the time without it [s]."""

    node_id: int
    lost_after_s: float


class Brake:
    """One brake: configures and enables it, and writes `wheel_torque_Nm()` to it until cancelled."""

    def __init__(
        self,
        description: BrakeDescription,
        bus: Bus,
        wheel_torque_Nm: Callable[[], float],
        watch: HeartbeatWatch | None,
        report: Callable[[str], None],
    ) -> None:
        self.description = description
        self._sdo = SdoClient(bus, description.node_id, timeout_s=SDO_TIMEOUT_S)
        self._wheel_torque_Nm = wheel_torque_Nm
        self._watch = watch
        self._report = report
        self._reported = ""
        self._mode = TORQUE_MODES[0][0]
        self._rated_Nm = math.nan
        self._limit_permille = 0
        self._restarted = False
        self._configured = False
        self._has_braked = False

    def take(self, frame: Frame) -> None:
        """Take a frame of the bus."""
        if frame.can_id == cob_id.SDO_ANSWER + self.description.node_id:
            self._sdo.handle(frame)
        elif frame.can_id == cob_id.ERROR_CONTROL + self.description.node_id and frame.data == b"\0":
            self._restarted = True
            self._sdo.interrupt()

    async def run(self) -> None:
        """Brake until cancelled; then write torque 0 and disable the voltage."""
        try:
            while True:
                try:
                    await self._configure()
                    await self._follow()
                    break
                except DriverError as error:
                    self._say(str(error))
                await asyncio.sleep(RETRY_S)
            await asyncio.Event().wait()  # in fault: the voltage stays off until the bench is started again
        finally:
            await self._release()

    async def _configure(self) -> None:
        """Read what the brake is, and write mode, limits of time, and torque 0."""
        self._restarted = False
        device_type = await self._sdo.read_number(_DEVICE_TYPE)
        if device_type & 0xFFFF != _DRIVE:
            raise self._error(f"its device type is 0x{device_type:08X}, no drive of CiA 402", _DEVICE_TYPE)
        self._rated_Nm = 1e-3 * await self._sdo.read_number(_RATED_TORQUE)
        if not self._rated_Nm:
            raise self._error("the rated torque is 0", _RATED_TORQUE, "Write it, in mN·m, with the maker's program")
        largest = await self._optional(_MAX_TORQUE)
        self._limit_permille = RATED_PERMILLE if largest is None else min(largest, RATED_PERMILLE)
        self._mode = _torque_mode(await self._optional(_SUPPORTED_MODES))
        if not self._mode:
            raise self._error("it has neither profile torque nor cyclic synchronous torque mode", _SUPPORTED_MODES)
        self._configured = True
        await self._write(_TARGET_TORQUE, 0, 2)
        await self._write(_MODE, self._mode, 1)
        await self._watch_heartbeat()

    async def _watch_heartbeat(self) -> None:
        """Let the brake disable its voltage by itself when this process ends without a word."""
        if self._watch is None:
            return
        entry = self._watch.node_id << 16 | round(1000 * self._watch.lost_after_s)
        try:
            await self._write(_HEARTBEAT_CONSUMER, entry, 4, subindex=1)
            await self._write(_ABORT_CONNECTION, _DISABLE_VOLTAGE, 2)
        except SdoAbortError as error:
            self._say(f"{error}. It does not stop by itself when the bench is killed")

    async def _follow(self) -> None:
        """Enable the brake and keep writing the target; return when it is in fault after it had braked."""
        last, checked = Controlword.DISABLE_VOLTAGE, False
        while not self._restarted:
            state = state_of(await self._sdo.read_number(_STATUSWORD))
            if state is DriveState.ENABLED:
                if not checked:
                    await self._check_mode()
                    checked = self._has_braked = True
                    self._reported = ""
                wanted = self.description.target_permille(self._wheel_torque_Nm(), self._rated_Nm, self._limit_permille)
                await self._write(_TARGET_TORQUE, wanted, 2)
            elif state is DriveState.FAULT and self._has_braked:
                await self._say_fault()
                return
            elif (step := enabling_step(state, last)) is not None:
                await self._write(_TARGET_TORQUE, 0, 2)
                await self._write(_CONTROLWORD, step, 2)
                last = step
            await asyncio.sleep(PERIOD_S)
        raise self._error("it was reset, and is configured anew")

    async def _check_mode(self) -> None:
        shown = await self._optional(_MODE_DISPLAY)
        if shown not in {None, self._mode}:
            await self._release()
            raise self._error(f"its mode of operation is {shown}, and {self._mode} was written", _MODE_DISPLAY)

    async def _say_fault(self) -> None:
        code = await self._optional(_ERROR_CODE)
        known = "" if code is None else f" (error code 0x{code:04X})"
        self._say(f"node {self.description.node_id}: fault{known}: no torque until the bench is started again")

    async def _release(self) -> None:
        if not self._configured:
            return  # nothing was written, and it may be no brake
        for index, value in ((_TARGET_TORQUE, 0), (_CONTROLWORD, Controlword.DISABLE_VOLTAGE)):
            with contextlib.suppress(DriverError):
                await self._write(index, value, 2)

    async def _optional(self, index: int) -> int | None:
        """Return an object's value, or None where there is no such object."""
        try:
            return await self._sdo.read_number(index)
        except SdoAbortError as error:
            if error.code in _ABSENT:
                return None
            raise

    async def _write(self, index: int, value: int, size: int, *, subindex: int = 0) -> None:
        await self._sdo.write(index, subindex, value.to_bytes(size, "little", signed=value < 0))

    def _error(self, what: str, index: int | None = None, remedy: str = "") -> DriveError:
        return DriveError(what, node_id=self.description.node_id, index=index, remedy=remedy)

    def _say(self, text: str) -> None:
        """Report a text, unless it was the last one as well."""
        if text != self._reported:
            self._reported = text
            self._report(f"brake: {text}")


class Brakes:
    """All brakes of a bench.

    Parameters
    ----------
    brakes
        The brakes.
    motors
        The motors of their wheels, whose PDOs must arrive.
    wheel_torque_Nm
        Returns the torques of the virtual soil [N·m] by wheel, shape (6,).
    stale_after_s
        Without a PDO of the wheel's motor for this long, the target torque is 0.
    watch
        The heartbeat that the brakes consume, or None.
    report
        Takes what is wrong, in words.
    """

    def __init__(
        self,
        brakes: Sequence[BrakeDescription],
        motors: Sequence[NodeDescription],
        wheel_torque_Nm: Callable[[], Array],
        *,
        stale_after_s: float,
        watch: HeartbeatWatch | None = None,
        report: Callable[[str], None] = lambda _text: None,
    ) -> None:
        self._descriptions = tuple(brakes)
        self._decoder = Decoder(motors)
        self._wheels = {node.node_id: node.wheel for node in motors}
        self._wheel_torque_Nm = wheel_torque_Nm
        self._stale_after_s = stale_after_s
        self._watch = watch
        self._report = report
        self._heard_s: dict[int | None, float] = {}
        self._brakes: list[Brake] = []

    async def run(self, bus: Bus) -> None:
        """Serve all brakes until cancelled; the answers to their last writes must still arrive at `take`."""
        self._brakes = [
            Brake(each, bus, partial(self._torque_Nm, each.wheel), self._watch, self._report)
            for each in self._descriptions
        ]
        async with asyncio.TaskGroup() as tasks:
            for each in self._brakes:
                tasks.create_task(each.run())

    def take(self, frame: Frame) -> None:
        """Take a frame that another node sent."""
        if not self._brakes or not frame.ordinary:
            return
        signal = self._decoder.decode(frame)
        if isinstance(signal, Reading) and any(quantity == MOTOR_SPEED for quantity, _ in signal.values):
            self._heard_s[self._wheels[signal.node_id]] = time.monotonic()
        for each in self._brakes:
            each.take(frame)

    def _torque_Nm(self, wheel: int) -> float:
        """Return a wheel's torque, or 0 where its motor has fallen silent."""
        heard_s = self._heard_s.get(wheel, -math.inf)
        return float(self._wheel_torque_Nm()[wheel]) if time.monotonic() - heard_s <= self._stale_after_s else 0.0


def _torque_mode(supported: int | None) -> int:
    """Return the first torque mode that 0x6502 has (None: mode 4); 0 where there is none."""
    if supported is None:
        return TORQUE_MODES[0][0]
    return next((mode for mode, bit in TORQUE_MODES if supported & bit), 0)
