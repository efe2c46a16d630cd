"""The master's SDO client for one node: runs the transfers of `canopen.sdo` over the bus, one after the other."""

from __future__ import annotations

import asyncio
import contextlib
from typing import TYPE_CHECKING

from regolithd.drivers.can.bus import READ_WITHIN_S
from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen import cob_id
from regolithd.drivers.canopen.sdo import ABORT_COMMAND, ABORT_TIMEOUT, Transfer, abort_request, download, upload
from regolithd.drivers.errors import (
    BusError,
    SdoBlockOfferedError,
    SdoError,
    SdoInterruptedError,
    SdoProtocolError,
    SdoTimeoutError,
)

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from regolithd.drivers.can.bus import Bus


class SdoClient:
    """Reads and writes the objects of one node. The reader of the bus passes the node's answers to `handle`."""

    def __init__(self, bus: Bus, node_id: int, *, timeout_s: float) -> None:
        self.node_id = node_id
        self.transfers = 0
        self.failures = 0
        self._bus = bus
        self._timeout_s = timeout_s
        self._answers: asyncio.Queue[bytes | None] = asyncio.Queue()
        self._one_at_a_time = asyncio.Lock()

    def handle(self, frame: Frame) -> None:
        """Take a frame of the node's SDO server; without a transfer under way it is discarded."""
        if self._one_at_a_time.locked():
            self._answers.put_nowait(frame.data)

    def interrupt(self) -> None:
        """Abandon the transfer under way: the node has restarted and has lost it."""
        if self._one_at_a_time.locked():
            self._answers.put_nowait(None)

    async def read(self, index: int, subindex: int = 0) -> bytes:
        """Return an object's bytes; a block upload in answer is aborted, and the object asked for once more.

        Raises
        ------
        SdoTimeoutError, SdoInterruptedError, SdoAbortError, SdoProtocolError
            See `drivers.errors`.
        BusError
            The request could not be sent.
        """
        with contextlib.suppress(SdoBlockOfferedError):
            return await self._run(upload(index, subindex), index, subindex)
        return await self._run(upload(index, subindex), index, subindex)

    async def read_number(self, index: int, subindex: int = 0, *, signed: bool = False) -> int:
        """Return an integer object's value; raises as `read` does."""
        return int.from_bytes(await self.read(index, subindex), "little", signed=signed)

    async def write(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object's bytes; raises as `read` does."""
        await self._run(download(index, subindex, data), index, subindex)

    async def _run(self, transfer: Transfer, index: int, subindex: int) -> bytes:
        async with self._one_at_a_time:
            self.transfers += 1
            while not self._answers.empty():
                self._answers.get_nowait()
            try:
                return await self._converse(transfer)
            except SdoInterruptedError as error:
                error.locate(self.node_id)
                raise  # not counted as a failure: the boot is repeated
            except BusError:
                self.failures += 1
                raise
            except SdoError as error:
                self.failures += 1
                if isinstance(error, SdoProtocolError):
                    await self._send(abort_request(index, subindex, ABORT_COMMAND))
                error.locate(self.node_id)
                raise
            except TimeoutError as error:
                self.failures += 1
                await self._send(abort_request(index, subindex, ABORT_TIMEOUT))
                raise SdoTimeoutError(
                    f"no answer within {self._timeout_s:g} s",
                    node_id=self.node_id,
                    index=index,
                    subindex=subindex,
                    remedy=f"Is the node powered and wired, and is its node-ID {self.node_id}?",
                ) from error

    async def _converse(self, transfer: Transfer) -> bytes:
        request = next(transfer)
        try:
            while True:
                await self._send(request or b"")
                async with _answered_within(self._timeout_s):
                    request = transfer.send(await self._answer())
                    while request is None:
                        request = transfer.send(await self._answer())
        except StopIteration as end:
            return end.value

    async def _answer(self) -> bytes:
        answer = await self._answers.get()
        if answer is None:
            raise SdoInterruptedError("the node restarted in the middle of the transfer")
        return answer

    async def _send(self, request: bytes) -> None:
        await self._bus.send(Frame(0, cob_id.SDO_REQUEST + self.node_id, request))


@contextlib.asynccontextmanager
async def _answered_within(time_s: float) -> AsyncIterator[None]:
    """Raise TimeoutError `READ_WITHIN_S` after `time_s`, counted from when the event loop comes to it."""
    loop = asyncio.get_running_loop()
    async with asyncio.timeout(None) as limit:
        due = loop.call_later(time_s, lambda: limit.reschedule(loop.time() + READ_WITHIN_S))
        try:
            yield
        finally:
            due.cancel()
