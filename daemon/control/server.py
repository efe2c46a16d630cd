"""Server of the control socket: takes requests from clients, and drives traverses.

Nothing else commands the wheels. There is one traverse at a time. The wheels are stopped when the connection that
commanded it is closed, when a node is lost, when a drive faults, and when the daemon stops.

At most `MAX_CLIENTS` are connected: another one replaces the oldest, first of those that have sent no whole request,
but never the one that commanded the traverse. Hence `stop` gets through however many connections are opened.
"""

from __future__ import annotations

import asyncio
import logging
import socket
import struct
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from pydantic import ValidationError

from regolithd.daemon.control.protocol import (
    LINE_LIMIT,
    REQUEST,
    Accepted,
    Code,
    Done,
    Ended,
    NodeLine,
    Progress,
    PublishComparisonRequest,
    Refused,
    Status,
    StatusRequest,
    StopRequest,
    TraverseRequest,
)
from regolithd.daemon.control.socket import ControlSocketError, open_control_socket
from regolithd.daemon.control.traverse import Clock, Traverse, TraverseError, Wheels, plan_traverse
from regolithd.daemon.control.traversed import Traversed
from regolithd.daemon.control.wheel_motion import WheelMotion
from regolithd.drivers.errors import DriverError
from regolithd.drivers.master.events import MotionStopped

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Mapping

    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.control.protocol import _Line
    from regolithd.daemon.messages.mismatch import ComparisonResult
    from regolithd.daemon.pipeline.snapshot import Estimate
    from regolithd.drivers.master.events import NetworkEvent
    from regolithd.drivers.master.status import NodeStatus

_log = logging.getLogger(__name__)
_CREDENTIALS = struct.Struct("3i")  # pid, uid, gid: unix(7), SO_PEERCRED
RETRY_S = 5.0
MAX_CLIENTS = 64
LINE_TIMEOUT_S = 5.0
"""A client that has begun a line must finish it within this time."""
_ACCEPTED_AT_A_TIME = 16  # a quarter of MAX_CLIENTS: a client's request is read before so many others could replace it
_WAITING_IN_KERNEL = 128


class Rover(Wheels, Protocol):
    """The part of `drivers.master.network.Network` that the control socket needs."""

    @property
    def status(self) -> Mapping[int, NodeStatus]:
        """State of each node, by node-ID."""


class ControlSink:
    """Serves the control socket; as a sink of the service, it gets wheel speeds and bus events.

    Parameters
    ----------
    configuration
        `[control]`, `[wheel]`, `[slip]`, `[drivetrain]` and the rover's name.
    rover
        Returns the network, or None while the bus is not open.
    broker
        Returns the state of the connection to the broker, as text.
    publish_comparison
        Publishes the result of a comparison, with its report.
    beat
        Called at least once a second while this task runs.
    """

    def __init__(
        self,
        configuration: Configuration,
        rover: Callable[[], Rover | None],
        *,
        broker: Callable[[], str] = lambda: "unknown",
        publish_comparison: Callable[[ComparisonResult], Awaitable[None]] | None = None,
        beat: Callable[[], None] = lambda: None,
        clock: Clock | None = None,
    ) -> None:
        self._configuration = configuration
        self._rover = rover
        self._broker = broker
        self._publish_comparison = publish_comparison
        self._beat = beat
        self._clock = clock or Clock()
        self._tasks: asyncio.TaskGroup | None = None
        self._traverse: Traverse | None = None
        self._owner: asyncio.StreamWriter | None = None
        self._clients: dict[asyncio.StreamWriter, bool] = {}  # oldest first; whether it has sent a whole request
        self._progress: Progress | None = None
        self._motion = WheelMotion(configuration)
        self._snapshots = 0
        self.problem = ""

    def estimate(self, estimate: Estimate) -> None:
        """Take the wheel speeds of a snapshot."""
        self._motion.take(estimate.snapshot)
        self._snapshots += 1

    @property
    def wheel_problem(self) -> str:
        """Which wheels have not done what the last traverse commanded; empty where all have."""
        return self._motion.problem

    def event(self, event: NetworkEvent) -> None:
        """End the traverse when the network has stopped the wheels."""
        if isinstance(event, MotionStopped) and self._traverse is not None:
            self._traverse.stop(event.text, quick=True)

    async def run(self) -> None:
        """Serve until cancelled. If the socket cannot be created, `problem` says why; try again every `RETRY_S`."""
        settings = self._configuration.control
        while True:
            try:
                listener = open_control_socket(settings.socket, settings.group)
            except ControlSocketError as error:
                self.problem = str(error)
                await self._pause(RETRY_S)
                continue
            self.problem = ""
            try:
                await self._serve(listener)
            finally:
                listener.close()
                settings.socket.unlink(missing_ok=True)

    async def _pause(self, seconds: float) -> None:
        for _ in range(int(2 * seconds)):
            self._beat()
            await asyncio.sleep(0.5)

    async def _serve(self, listener: socket.socket) -> None:
        async with asyncio.TaskGroup() as tasks:
            self._tasks = tasks

            def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
                tasks.create_task(self._serve_client(reader, writer))

            server = await asyncio.start_unix_server(
                accept, sock=listener, limit=LINE_LIMIT, backlog=_ACCEPTED_AT_A_TIME
            )
            listener.listen(_WAITING_IN_KERNEL)  # asyncio has set it to the number that it accepts at a time
            try:
                while True:
                    self._beat()
                    await asyncio.sleep(0.5)
            finally:
                server.close()

    async def _serve_client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer one client until it closes the connection, or another one takes its place."""
        self._make_room()
        self._clients[writer] = False
        try:
            while line := await _read_line(reader):
                if writer in self._clients:
                    self._clients[writer] = True
                _send(writer, await self._answer(line, writer))
                await writer.drain()
        except (OSError, ValueError) as error:  # OSError: also a time-out; ValueError: a line over LINE_LIMIT
            _log.info("a client of the control socket was disconnected: %s", error or type(error).__name__)
        finally:
            self._clients.pop(writer, None)
            if self._owner is writer and self._traverse is not None:
                self._traverse.stop("the client that commanded it disconnected", quick=True)
            writer.close()

    def _make_room(self) -> None:
        """Disconnect the oldest client if there are too many."""
        if len(self._clients) < MAX_CLIENTS:
            return
        others = [writer for writer in self._clients if writer is not self._owner]
        oldest = next((writer for writer in others if not self._clients[writer]), others[0])
        del self._clients[oldest]
        oldest.close()  # ends its task once its last request is answered

    async def _answer(self, line: bytes, writer: asyncio.StreamWriter) -> _Line:
        try:
            request = REQUEST.validate_json(line)
        except ValidationError as error:
            problems = "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())
            return Refused(code=Code.BAD_REQUEST, text=problems, remedy="The commands are traverse, stop and status.")
        match request:
            case TraverseRequest():
                return self._begin(request, writer)
            case StopRequest():
                return await self._stop(request, writer)
            case StatusRequest():
                return self._status()
            case PublishComparisonRequest():
                return await self._publish_result(request.result)

    async def _publish_result(self, result: ComparisonResult) -> _Line:
        """Publish a result; its report, if any, is below the recordings: no other file of the daemon's is published."""
        recordings = self._configuration.recording.directory
        if self._publish_comparison is None or (result.report and not _is_below(result.report, recordings)):
            return Refused(code=Code.BAD_REQUEST, text=f"{result.report} is not below {recordings}.")
        try:
            await self._publish_comparison(result)
        except OSError as error:
            return Refused(code=Code.BAD_REQUEST, text=f"The report cannot be read: {error}.")
        return Done(text="The result is published, as soon as the broker is connected.")

    def _begin(self, request: TraverseRequest, writer: asyncio.StreamWriter) -> _Line:
        settings = self._configuration.control
        try:
            plan = plan_traverse(
                request.distance_m,
                request.speed_m_s,
                radius_m=self._configuration.wheel.radius_m,
                speed_limit_m_s=settings.speed_limit_m_s,
                distance_limit_m=settings.distance_limit_m,
            )
        except TraverseError as error:
            return Refused(code=Code.LIMIT, text=str(error))
        if self._traverse is not None:
            return Refused(code=Code.BUSY, text="A traverse is being driven.", remedy="`regolithd stop` ends it.")
        rover = self._rover()
        if refusal := _not_ready(rover):
            return refusal
        assert rover is not None  # noqa: S101  # checked by _not_ready
        assert self._tasks is not None  # noqa: S101  # set before a client is served
        _log.info("traverse of %g m at %g m/s, commanded by %s", plan.distance_m, plan.speed_m_s, _client_name(writer))
        self._motion.begin(forward=plan.speed_m_s > 0)
        self._traverse = Traverse(
            plan,
            rover,
            self._motion,
            lambda elapsed: self._report_progress(elapsed, writer),
            self._clock,
        )
        self._owner = writer
        self._tasks.create_task(self._drive(self._traverse, writer))
        return Accepted(duration_s=plan.duration_s, wheel_speed_rad_s=plan.wheel_speed_rad_s)

    async def _drive(self, traverse: Traverse, writer: asyncio.StreamWriter) -> None:
        begun_ns = time.time_ns()
        try:
            outcome = await traverse.run()
        finally:
            self._traverse = self._owner = self._progress = None
        self._note_end(Traversed(from_ns=begun_ns, to_ns=time.time_ns(), ending=outcome.ending.value))
        _log.info("traverse %s after %.2f s: %s", outcome.ending.value, outcome.elapsed_s, outcome.text)
        turned_m, text = self._motion.turned_m, outcome.text
        _send(writer, Ended(ending=outcome.ending, elapsed_s=outcome.elapsed_s, turned_m=turned_m, text=text))
        with suppress(ConnectionError):
            await writer.drain()

    def _note_end(self, traversed: Traversed) -> None:
        """Note the end beside the recordings; without recordings there is nothing to compare."""
        recording = self._configuration.recording
        if recording.enabled:
            try:
                traversed.write(recording.directory)
            except OSError as error:
                _log.warning("the end of the traverse could not be noted in %s: %s", recording.directory, error)

    def _report_progress(self, elapsed_s: float, writer: asyncio.StreamWriter) -> None:
        self._progress = Progress(elapsed_s=elapsed_s, turned_m=self._motion.turned_m)
        _send(writer, self._progress)

    async def _stop(self, request: StopRequest, writer: asyncio.StreamWriter) -> _Line:
        who = _client_name(writer)
        _log.info("stop commanded by %s", who)
        if self._traverse is not None:
            self._traverse.stop(f"stopped by {who}", quick=request.quick)
            return Done(text="The traverse is being stopped.")
        rover = self._rover()
        if rover is None:
            return Done(text="The bus is not open: this daemon drives nothing.")
        try:
            await rover.disable()
        except DriverError as error:
            return Refused(code=Code.NOT_READY, text=str(error), remedy="Cut the power of the motors.")
        return Done(text="No traverse was being driven; the drives are disabled.")

    def _status(self) -> Status:
        rover = self._rover()
        nodes = rover.status if rover is not None else {}
        bus = self._configuration.bus
        return Status(
            rover=self._configuration.rover.name,
            bus=f"{bus.interface} {bus.channel}: {'open' if rover is not None else 'not open'}",
            broker=self._broker(),
            rate_Hz=self._configuration.sync.rate_Hz,
            snapshots=self._snapshots,
            traverse=self._progress,
            nodes=tuple(_node_line(status) for status in nodes.values()),
        )


async def _read_line(reader: asyncio.StreamReader) -> bytes:
    """Return the next line, empty at the end; wait for its begin without a limit, for its end `LINE_TIMEOUT_S`.

    Raises
    ------
    TimeoutError, ValueError
        The line was not finished in time, or is too long.
    """
    begin = await reader.read(1)
    if begin in {b"", b"\n"}:
        return begin
    async with asyncio.timeout(LINE_TIMEOUT_S):
        return begin + await reader.readline()


def _is_below(path: str, folder: Path) -> bool:
    return Path(path).resolve().is_relative_to(folder.resolve())


def _send(writer: asyncio.StreamWriter, reply: _Line) -> None:
    if not writer.is_closing():
        writer.write(reply.line())


def _not_ready(rover: Rover | None) -> Refused | None:
    """Return the refusal if no traverse can begin now, or None."""
    if rover is None:
        return Refused(code=Code.NOT_READY, text="The CAN bus is not open.", remedy="`regolithd check` says why.")
    missing = [
        f"{status.node.kind} {node_id} is {status.phase.value}"
        for node_id, status in rover.status.items()
        if status.node.required and status.phase.value != "operational"
    ]
    if not missing:
        return None
    return Refused(
        code=Code.NOT_READY,
        text=f"Not every node is operational: {', '.join(missing)}.",
        remedy="`regolithd status` says why; power them, or correct [nodes].",
    )


def _node_line(status: NodeStatus) -> NodeLine:
    node = status.node
    return NodeLine(
        node_id=node.node_id,
        kind=node.kind,
        wheel=None if node.wheel is None else node.wheel + 1,
        phase=status.phase.value,
        drive_state=None if status.drive_state is None else status.drive_state.value,
        text=status.text,
    )


def _client_name(writer: asyncio.StreamWriter) -> str:
    """Return user and process of the client, from the kernel (SO_PEERCRED)."""
    connection = writer.get_extra_info("socket")
    try:
        raw = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    except OSError:
        return "an unknown user"
    pid, uid, _ = _CREDENTIALS.unpack(raw)
    return f"user {uid} (process {pid})"
