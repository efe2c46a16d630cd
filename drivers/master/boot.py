"""Booting a node: reset, identify, configure, start (the boot-slave process of CiA 302-2, for one master and no files).

    NMT reset ─▶ boot-up ─▶ 0x1000, 0x1018 ─▶ each write, read back ─▶ units ─▶ heartbeat ─▶ NMT start ─▶ operational

Each failure has a `BootReason` and a remedy. Compared with the error letters of CiA 302-2:

    B, C, D, M, N, O, J, K      the same, one reason each (see `BootReason`)
    E, F                        no boot-up: every node is reset, so its state is not read first
    A                           does not occur: only configured nodes are booted
    G, H, I                     software download: not supported
    L                           does not occur: the reset ends the operational state
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.nmt import NmtCommand, NmtState
from regolithd.drivers.devices.units import UnknownUnitError
from regolithd.drivers.errors import (
    BusError,
    DictionaryError,
    DriverError,
    SdoAbortError,
    SdoInterruptedError,
    SdoProtocolError,
    SdoTimeoutError,
)
from regolithd.drivers.master.boot_configuration import Write, boot_writes
from regolithd.drivers.master.boot_error import BootError, BootReason
from regolithd.drivers.master.identity import compare_identity, read_identity

if TYPE_CHECKING:
    from regolithd.drivers.master.events import Identity
    from regolithd.drivers.master.remote_node import RemoteNode

_HEARTBEATS = 5  # within which the node must report the commanded state


@dataclass(frozen=True, slots=True)
class BootSettings:
    """Settings of the boot process, the same for every node; times in seconds."""

    heartbeat_s: float
    master_id: int
    master_lost_after_s: float
    boot_up_timeout_s: float


async def boot(remote: RemoteNode, settings: BootSettings) -> Identity:
    """Boot one node into operational and return its identity.

    Raises
    ------
    BootError
        It could not be booted; it stays in the state in which that happened, not operational.
    """
    try:
        return await _Boot(remote, settings).run()
    except DictionaryError as error:
        raise BootError(
            BootReason.UNUSABLE_EDS,
            error.what,
            node_id=remote.node.node_id,
            index=error.index,
            subindex=error.subindex,
        ) from error
    except BusError as error:
        raise BootError(BootReason.BUS_DOWN, error.what, node_id=remote.node.node_id) from error


class _Boot:
    """One run of the boot process."""

    def __init__(self, remote: RemoteNode, settings: BootSettings) -> None:
        self._remote = remote
        self._settings = settings
        self._boot_ups = remote.boot_ups

    async def run(self) -> Identity:
        await self._reset()
        try:
            identity = await self._identify_restarted()
            await self._configure()
            await self._read_units()
        except SdoInterruptedError as error:
            raise self._error(BootReason.RESTARTED, "booted up again while it was being configured") from error
        except SdoTimeoutError as error:
            raise self._error(BootReason.FELL_SILENT, error.what, error) from error
        except SdoProtocolError as error:
            raise self._error(BootReason.MALFORMED_ANSWER, error.what, error) from error
        await self._start()
        return identity

    async def _reset(self) -> None:
        remote, timeout_s = self._remote, self._settings.boot_up_timeout_s
        before = remote.boot_ups
        await remote.send_command(NmtCommand.RESET_NODE)
        if not await remote.changed.until(lambda: remote.boot_ups > before, timeout_s):
            raise self._error(BootReason.NO_BOOT_UP, f"no boot-up message within {timeout_s:g} s of the NMT reset")
        self._boot_ups = remote.boot_ups

    async def _identify_restarted(self) -> Identity:
        """Identify the node; once more where it boots up meanwhile, as nothing has been written yet.

        That happens after power-on: the boot-up message taken for the answer to the reset was the one of power-on.
        """
        try:
            return await self._identify()
        except SdoInterruptedError:
            return await self._identify()
        finally:
            self._boot_ups = self._remote.boot_ups

    async def _identify(self) -> Identity:
        try:
            identity = await read_identity(self._remote)
        except SdoTimeoutError as error:
            raise self._error(BootReason.NO_SDO_ANSWER, error.what, error) from error
        except SdoAbortError as error:
            raise self._error(BootReason.WRONG_DEVICE_TYPE, error.what, error) from error
        difference = compare_identity(self._remote.node, identity)
        if difference is not None:
            raise self._error(*difference)
        return identity

    async def _configure(self) -> None:
        settings = self._settings
        writes = boot_writes(
            self._remote.node,
            heartbeat_s=settings.heartbeat_s,
            master_id=settings.master_id,
            master_lost_after_s=settings.master_lost_after_s,
        )
        for write in writes:
            try:
                await self._write(write)
            except SdoAbortError as error:
                raise self._error(BootReason.CONFIGURATION_REFUSED, error.what, error) from error
            self._check_restart()

    async def _write(self, write: Write) -> None:
        sdo = self._remote.sdo
        index, subindex = write.index, write.subindex
        look_first = write.keep or write.read_only
        present = await sdo.read_number(index, subindex) if look_first else 0
        if not write.read_only and not (look_first and present & write.mask == write.value & write.mask):
            for data in write.steps(present):
                await sdo.write(index, subindex, data)
            present = await sdo.read_number(index, subindex, signed=write.signed)
        if present & write.mask != write.value & write.mask:
            raise BootError(
                BootReason.FIXED_OTHERWISE if write.read_only else BootReason.CONFIGURATION_NOT_KEPT,
                write.difference(present),
                node_id=self._remote.node.node_id,
                index=index,
                subindex=subindex,
            )

    async def _read_units(self) -> None:
        """Read the objects in which the device states its units; their factors must be plausible."""
        remote = self._remote
        for index, subindex in remote.node.device.stated_units:
            try:
                remote.stated[index, subindex] = await remote.sdo.read_number(index, subindex)
            except SdoAbortError as error:
                raise self._error(BootReason.UNKNOWN_UNIT, error.what, error) from error
        try:
            remote.check_units()
        except UnknownUnitError as error:
            raise self._error(BootReason.UNKNOWN_UNIT, str(error)) from error

    async def _start(self) -> None:
        remote = self._remote
        timeout_s = _HEARTBEATS * self._settings.heartbeat_s
        before = remote.heard
        if not await remote.changed.until(lambda: remote.heard > before, timeout_s):
            raise self._error(BootReason.NO_HEARTBEAT, f"no heartbeat within {timeout_s:g} s")
        self._check_restart()
        await remote.send_command(NmtCommand.START)
        if not await remote.changed.until(lambda: remote.state is NmtState.OPERATIONAL, timeout_s):
            self._check_restart()
            said = remote.state.text if remote.state else "nothing"
            raise self._error(BootReason.NOT_OPERATIONAL, f"still reports {said} {timeout_s:g} s after the NMT start")

    def _check_restart(self) -> None:
        if self._remote.boot_ups != self._boot_ups:
            raise self._error(BootReason.RESTARTED, "booted up again while it was being configured")

    def _error(self, reason: BootReason, what: str, cause: DriverError | None = None) -> BootError:
        place = cause or DriverError("")
        return BootError(reason, what, node_id=self._remote.node.node_id, index=place.index, subindex=place.subindex)
