"""The master of one motor controller (CiA 402, profile velocity mode).

States are changed by SDO, which is confirmed and does not wait for a SYNC; speeds and stops go by RPDO 1, one frame
with the controlword and the target velocity, so that no drive receives only one of them.
"""

from __future__ import annotations

import asyncio
import math
from contextlib import suppress
from typing import TYPE_CHECKING

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen.emcy import error_text
from regolithd.drivers.devices.decoding.pdo import rpdos
from regolithd.drivers.devices.device import Commanded
from regolithd.drivers.devices.motor_controller import (
    CONTROLWORD,
    ERROR_CODE,
    MAX_VELOCITY,
    MODE_DISPLAY,
    PROFILE_VELOCITY,
    STATUSWORD_OBJECT,
    TARGET_VELOCITY,
)
from regolithd.drivers.devices.units import UnknownUnitError
from regolithd.drivers.errors import DriveError, SdoAbortError
from regolithd.drivers.master.cia402 import Controlword, DriveState, at_standstill, enabling_step, state_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.drivers.can.bus import Bus
    from regolithd.drivers.devices.node import NodeDescription
    from regolithd.drivers.master.remote_node import RemoteNode

ERROR_HISTORY = 0x1003  # sub-index 1: the newest error
_ENABLE_TIMEOUT_S = 3.0
_STOP_TIMEOUT_S = 3.0
_RESEND_S = 0.2  # a drive still enabled this long after the quick stop has not received it
_POLL_S = 0.02
_STOPPED = (DriveState.SWITCH_ON_DISABLED, DriveState.READY, DriveState.SWITCHED_ON, DriveState.FAULT)


class Drive:
    """Commands one motor controller. `statusword` is the last one received, by TPDO or SDO."""

    def __init__(self, bus: Bus, remote: RemoteNode) -> None:
        self.remote = remote
        self.node_id = remote.node.node_id
        self.statusword: int | None = None
        self.reported = DriveState.UNKNOWN  # in the last `DriveStateChanged` event
        self._limit = 0  # 0x607F when it was enabled, in velocity units; 0: none
        self._bus = bus
        self._rpdo = rpdos(remote.node.device)[0]
        self._velocity_unit = next(each.scale for each in _commanded(remote.node) if each.index == TARGET_VELOCITY)

    @property
    def state(self) -> DriveState:
        """State by the last statusword."""
        return DriveState.UNKNOWN if self.statusword is None else state_of(self.statusword)

    async def enable(self) -> None:
        """Bring the drive to operation enabled with target velocity 0; a fault is reset first.

        Raises
        ------
        DriveError
            It does not get there in time.
        SdoError, BusError
            Its statusword could not be read.
        """
        sdo = self.remote.sdo
        mode = await sdo.read_number(MODE_DISPLAY, signed=True)
        if mode != PROFILE_VELOCITY:
            raise self._error(f"is in mode {mode} instead of profile velocity mode (3)", "Boot the node again")
        with suppress(SdoAbortError):  # optional in CiA 402
            self._limit = await sdo.read_number(MAX_VELOCITY)
        await sdo.write(TARGET_VELOCITY, 0, bytes(4))
        deadline = asyncio.get_running_loop().time() + _ENABLE_TIMEOUT_S
        last = Controlword.DISABLE_VOLTAGE
        await self._write_controlword(last)  # bit 7 at 0: a fault reset after it is a rising edge
        while await self.read_state() is not DriveState.ENABLED:
            word = enabling_step(self.state, last)
            if word is not None:
                await self._write_controlword(word)
                last = word
            if asyncio.get_running_loop().time() > deadline:
                raise await self._not_enabled()
            await asyncio.sleep(_POLL_S)

    async def read_state(self) -> DriveState:
        """Read the statusword by SDO and return the state."""
        self.statusword = await self.remote.sdo.read_number(STATUSWORD_OBJECT)
        return self.state

    def take_statusword(self, statusword: int) -> DriveState:
        """Take a statusword that came by TPDO, and return its state."""
        self.statusword = statusword
        self.reported = self.state
        return self.reported

    def forget(self) -> None:
        """Forget the statusword of a lost drive."""
        self.statusword = None
        self.reported = DriveState.UNKNOWN

    async def turn(self, motor_speed_rad_s: float) -> None:
        """Send the target velocity [rad/s at the motor, forward positive]; the drive must be in operation enabled."""
        direction = -1 if self.remote.node.mirrored else 1
        await self._command(Controlword.ENABLE_OPERATION, direction * round(motor_speed_rad_s / self._factor()))

    @property
    def speed_limit_rad_s(self) -> float:
        """The highest speed [rad/s at the motor] that it turns at, as it said when it was enabled.

        Raises
        ------
        DriveError
            The unit of its velocities is not known.
        """
        return self._limit * self._factor() if self._limit else math.inf

    async def send_quick_stop(self) -> None:
        """Send the quick stop and do not wait."""
        await self._command(Controlword.QUICK_STOP, 0)

    async def until_stopped(self) -> None:
        """Wait until the drive has stopped after a quick stop; where the PDO has no effect, it is repeated by SDO.

        Raises
        ------
        DriveError
            It has not, in time.
        """
        begun = asyncio.get_running_loop().time()
        while await self.read_state() not in _STOPPED and not (
            self.state is DriveState.QUICK_STOP and self._standing()
        ):
            waited_s = asyncio.get_running_loop().time() - begun
            if self.state is DriveState.ENABLED and waited_s > _RESEND_S:
                await self._write_controlword(Controlword.QUICK_STOP)
            if waited_s > _STOP_TIMEOUT_S:
                raise self._error(f"does not stop: it is in {self.state}", "Cut the motors' supply")
            await asyncio.sleep(_POLL_S)

    async def disable(self) -> None:
        """Disable the motor's voltage; it must be at standstill."""
        await self._write_controlword(Controlword.DISABLE_VOLTAGE)

    def _factor(self) -> float:
        try:
            return self.remote.factor(self._velocity_unit)
        except UnknownUnitError as error:
            raise self._error(f"cannot be commanded: {error}", "Boot the node again") from error

    def _standing(self) -> bool:
        return self.statusword is not None and at_standstill(self.statusword)

    async def _command(self, word: Controlword, velocity: int) -> None:
        data = self._rpdo.pack(word, velocity)
        await self._bus.send(Frame(0, self._rpdo.cob_id(self.node_id), data))

    async def _write_controlword(self, word: Controlword) -> None:
        await self.remote.sdo.write(CONTROLWORD, 0, word.to_bytes(2, "little"))

    async def _not_enabled(self) -> DriveError:
        remedy = "See its emergency messages; cut its supply and switch it on again"
        if self.state is DriveState.FAULT:
            return self._error(f"stays in fault{await self._error_code()}", remedy)
        return self._error(f"is still in {self.state} after {_ENABLE_TIMEOUT_S:g} s", remedy)

    async def _error_code(self) -> str:
        """Return the fault's code in words: from 0x603F, which is optional, or the newest entry of 0x1003."""
        for index, subindex in ((ERROR_CODE, 0), (ERROR_HISTORY, 1)):
            with suppress(SdoAbortError):
                code = await self.remote.sdo.read_number(index, subindex) & 0xFFFF
                return f", error code 0x{code:04X}: {error_text(code, self.remote.node.device.error_texts)}"
        return "; it has no object that holds the error code"

    def _error(self, what: str, remedy: str) -> DriveError:
        return DriveError(what, node_id=self.node_id, remedy=remedy)


def _commanded(node: NodeDescription) -> Iterator[Commanded]:
    for layout in node.device.rpdos:
        yield from (each for each in layout.objects if isinstance(each, Commanded))
