"""The control socket: its permissions, its protocol, and what happens when a client disconnects."""

import asyncio
import os
import socket
import stat
import subprocess
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from control_rig import GROUP, LONG, SHORT, Client, Rover, serving
from hypothesis import given, settings
from hypothesis import strategies as st
from subscriber import until

from regolithd.daemon.config.configuration import Configuration, Control
from regolithd.daemon.control.client import ControlError, control_connection
from regolithd.daemon.control.protocol import LINE_LIMIT, REPLY, Accepted, Ended, Progress, Refused, StatusRequest
from regolithd.daemon.control.server import ControlSink
from regolithd.daemon.control.socket import ControlSocketError, open_control_socket
from regolithd.daemon.control.traversed import Traversed
from regolithd.drivers.master.events import MotionStopped
from regolithd.drivers.master.status import NodePhase


async def test_only_the_group_may_open_it(tmp_path: Path) -> None:
    """The socket has mode 0660 and the configured group, and is removed when the daemon stops."""
    async with serving(tmp_path, Rover()) as (_, path):
        found = path.stat()
        assert stat.S_IMODE(found.st_mode) == 0o660
        assert found.st_gid == os.getgid()
    assert not path.exists()


_CONNECT = "import socket, sys; socket.socket(socket.AF_UNIX).connect(sys.argv[1])"
NOBODY = 65534


@pytest.mark.parametrize(("group", "error"), [(NOBODY, ""), (NOBODY - 1, "PermissionError")])
async def test_the_kernel_lets_the_groups_members_in_and_nobody_else(group: int, error: str) -> None:
    """Another user may connect as a member of the group, and may not otherwise."""
    if os.geteuid() != 0:
        group, error = os.getegid(), ""  # only root can become somebody else: at least we get in
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:  # every user may pass through
        os.chmod(folder, 0o755)  # noqa: PTH101  # at once: nothing else runs yet
        control = {"group": str(NOBODY)} if os.geteuid() == 0 else {}
        who = {"user": NOBODY, "group": group, "extra_groups": []} if os.geteuid() == 0 else {}
        async with serving(Path(folder), Rover(), **control) as (_, path):
            command = ["python3", "-c", _CONNECT, path]
            done = await asyncio.to_thread(
                lambda: subprocess.run(command, capture_output=True, text=True, check=False, **who)
            )
    assert done.stderr.strip().splitlines()[-1:] == ([] if not error else [f"{error}: [Errno 13] Permission denied"])


async def test_a_traverse_is_driven_and_its_end_is_reported(tmp_path: Path) -> None:
    """The client gets the duration at once, the progress during the traverse, and its end."""
    rover = Rover()
    async with serving(tmp_path, rover) as (_, path):
        client = await Client.to(path)
        accepted = await client.ask(SHORT | {"distance_m": 0.04})
        assert isinstance(accepted, Accepted)
        assert accepted.duration_s == pytest.approx(0.8)
        assert isinstance(await client.hear(), Progress)
        end = await client.hear_end()
        assert (end.ending, end.turned_m) == ("finished", pytest.approx(0.04, abs=0.05 * 0.8 / 10))  # measured
    assert rover.told == ["enable", "speed 0.667", "speed 0.000", "disable"]
    noted = Traversed.read(tmp_path)
    assert noted.ending == "finished"
    assert 0.8e9 <= noted.to_ns - noted.from_ns < 20e9


@pytest.mark.parametrize(
    ("distance_m", "shares", "ending", "turned_m", "said"),
    [
        (
            1.0,
            (1, 1, 0, 1, 1, 1),
            "quick-stopped",
            None,
            "at 0.667 rad/s, and measured: wheel 3 (node 3) at 0.000 rad/s",
        ),
        (
            0.02,
            (1, 1, 0, 1, 1, 1),
            "incomplete",
            0.02 * 5 / 6,
            "of 0.020 m commanded, only these were measured: wheel 3",
        ),
        (0.04, (0.85,) * 6, "incomplete", 0.85 * 0.04, "wheel 6 (node 6) 0.03"),
    ],
)
async def test_wheels_that_do_not_turn_as_commanded_end_it(
    tmp_path: Path, distance_m: float, shares: tuple[float, ...], ending: str, turned_m: float | None, said: str
) -> None:
    """The end names wheel and node, the distance is the measured one, and the problem stays for the alarm."""
    rover = Rover(shares=np.array(shares))
    async with serving(tmp_path, rover) as (sink, path):
        client = await Client.to(path)
        await client.ask({"command": "traverse", "distance_m": distance_m, "speed_m_s": 0.05})
        end = await client.hear_end()
        assert end.ending == ending
        assert said in end.text
        assert sink.wheel_problem
        assert sink.wheel_problem in end.text
        assert turned_m is None or end.turned_m == pytest.approx(turned_m, abs=0.002)
        rover.shares = np.ones(6)
        await client.ask(SHORT)
        assert not sink.wheel_problem


async def test_the_client_that_commanded_it_disconnects(tmp_path: Path) -> None:
    """The wheels are quick-stopped when the connection that commanded the traverse closes."""
    rover = Rover()
    async with serving(tmp_path, rover) as (_, path):
        client = await Client.to(path)
        await client.ask(LONG)
        await until(lambda: "speed 0.293" in rover.told)
        client.writer.transport.abort()
        await until(lambda: rover.told[-2:] == ["quick stop", "disable"])
        again = await Client.to(path)
        assert isinstance(await again.ask(SHORT), Accepted)


async def test_another_client_that_disconnects_changes_nothing(tmp_path: Path) -> None:
    """A client that asked for the status may disconnect during a traverse without effect."""
    rover = Rover()
    async with serving(tmp_path, rover) as (_, path):
        client = await Client.to(path)
        await client.ask(LONG)
        onlooker = await Client.to(path)
        assert (await onlooker.ask({"command": "status"})).nodes[2].text == "said"
        onlooker.writer.close()
        refused = await (await Client.to(path)).ask(SHORT)
        assert isinstance(refused, Refused)
        assert refused.code == "busy"
        assert "quick stop" not in rover.told
        client.say({"command": "stop"})
        while not isinstance(end := await client.hear(), Ended):
            pass
        assert end.ending == "stopped"


@pytest.mark.parametrize(("quick", "ending"), [(True, "quick-stopped"), (False, "stopped")])
async def test_anybody_in_the_group_may_stop_it(tmp_path: Path, quick: bool, ending: str) -> None:
    """Another client may stop the traverse, and the commanding client gets its end."""
    async with serving(tmp_path, Rover()) as (_, path):
        client = await Client.to(path)
        await client.ask(LONG)
        other = await Client.to(path)
        assert (await other.ask({"command": "stop", "quick": quick})).event == "done"
        end = await client.hear_end()
        assert end.ending == ending
        assert f"stopped by user {os.getuid()}" in end.text


async def test_a_lost_node_ends_it(tmp_path: Path) -> None:
    """The network has stopped the wheels, and the client gets the reason."""
    async with serving(tmp_path, Rover()) as (sink, path):
        client = await Client.to(path)
        await client.ask(LONG)
        sink.event(MotionStopped(0, 3, "motion stopped: node 3 is silent"))
        end = await client.hear_end()
        assert (end.ending, end.text) == ("quick-stopped", "motion stopped: node 3 is silent")


async def test_stop_without_a_traverse_takes_the_power_off_all_the_same(tmp_path: Path) -> None:
    """`stop` disables the drives also when no traverse is driven."""
    rover = Rover()
    async with serving(tmp_path, rover) as (_, path):
        client = await Client.to(path)
        assert "drives are disabled" in (await client.ask({"command": "stop"})).text
        assert rover.told == ["disable"]
        rover.problem = "does not stop"
        assert (await client.ask({"command": "stop"})).remedy == "Cut the power of the motors."


@pytest.mark.parametrize(
    ("rover", "said"),
    [(None, "bus is not open"), (Rover(phase=NodePhase.LOST), "motor 3 is lost"), (Rover(), "at most 0.05 m/s")],
)
async def test_a_traverse_that_cannot_be_is_refused_with_the_reason(
    tmp_path: Path, rover: Rover | None, said: str
) -> None:
    """No command is sent to the drives then."""
    async with serving(tmp_path, rover) as (_, path):
        refused = await (await Client.to(path)).ask(LONG | ({"speed_m_s": 9} if said.endswith("m/s") else {}))
        assert isinstance(refused, Refused)
        assert said in refused.text
    assert rover is None or rover.told == []


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"{",
        b"\xff\xfe",
        b"[]",
        b"null",
        b'{"command": "dance"}',
        b'{"command": "traverse"}',
        b'{"command": "traverse", "distance_m": "far", "speed_m_s": 1}',
        b'{"command": "traverse", "distance_m": 1, "speed_m_s": NaN}',
        b'{"command": "traverse", "distance_m": 1, "speed_m_s": 0.01, "over": "mqtt"}',
    ],
)
async def test_an_invalid_request_is_refused_and_the_connection_goes_on(tmp_path: Path, line: bytes) -> None:
    """The refusal names the commands, and the next request is answered."""
    rover = Rover()
    async with serving(tmp_path, rover) as (_, path):
        client = await Client.to(path)
        refused = await client.ask(line)
        assert isinstance(refused, Refused)
        assert refused.code == "bad-request"
        assert (await client.ask({"command": "status"})).event == "status"
    assert rover.told == []


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=200))
def test_no_line_ever_raises_anything(line: bytes) -> None:
    """Any line is answered by a reply of the protocol."""
    sink = ControlSink(Configuration(), lambda: None)
    reply = asyncio.run(sink._answer(line, None))  # type: ignore[arg-type]
    assert REPLY.validate_json(reply.line()) == reply


async def test_a_line_without_end_is_cut_off_and_the_daemon_goes_on(tmp_path: Path) -> None:
    """A line over the limit closes its connection, and other clients are served."""
    async with serving(tmp_path, Rover()) as (_, path):
        client = await Client.to(path)
        client.writer.write(b"x" * (2 * LINE_LIMIT))
        with suppress(ConnectionError):
            assert await client.reader.read() == b""
        assert (await (await Client.to(path)).ask({"command": "status"})).event == "status"


async def test_the_socket_of_a_killed_daemon_is_taken_over(tmp_path: Path) -> None:
    """The socket of a killed daemon is replaced; that of a running one, and another kind of file, are not."""
    path = tmp_path / "control.sock"
    dead = socket.socket(socket.AF_UNIX)
    dead.bind(str(path))
    dead.close()
    with open_control_socket(path, GROUP), pytest.raises(ControlSocketError, match="another regolithd answers"):
        open_control_socket(path, GROUP)
    path.unlink()
    path.write_text("a file")
    with pytest.raises(ControlSocketError, match="is not a socket"):
        open_control_socket(path, GROUP)
    with pytest.raises(ControlSocketError, match=r"groupadd --system rovers"):
        open_control_socket(tmp_path / "other.sock", "rovers")


def test_whoever_finds_the_socket_s_file_is_answered(tmp_path: Path) -> None:
    """A client that waits for the file and connects at once is never refused, and no other file is left."""
    path = tmp_path / "control.sock"

    def connect() -> None:
        while not path.exists():
            pass
        with socket.socket(socket.AF_UNIX) as client:
            client.connect(str(path))

    with ThreadPoolExecutor(1) as pool:
        for _ in range(200):
            connected = pool.submit(connect)
            with open_control_socket(path, GROUP):
                connected.result()
                assert [file.name for file in tmp_path.iterdir()] == ["control.sock"]
            path.unlink()


async def test_a_socket_that_cannot_be_made_is_reported_and_the_rest_goes_on(tmp_path: Path) -> None:
    """The reason is in `problem`, the task keeps running, and creation is tried again."""
    configuration = Configuration(control=Control(socket=tmp_path / "control.sock", group="no-such-group"))
    sink = ControlSink(configuration, lambda: None)
    task = asyncio.create_task(sink.run())
    await until(lambda: "no-such-group" in sink.problem)
    assert not task.done()
    task.cancel()
    with suppress(asyncio.CancelledError):
        await task


async def test_clients_are_told_why_they_cannot_speak_to_the_daemon(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of no daemon, no permission and a closed connection has its message and its exit status."""
    path = tmp_path / "control.sock"

    async def failure(prepare: Callable[[], object] = lambda: None) -> ControlError:
        prepare()
        with pytest.raises(ControlError) as caught:
            async with control_connection(path):
                pass
        return caught.value

    assert "No daemon is running" in str(error := await failure())
    assert error.exit_status == 69

    async def forbidden(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patch:
        patch.setattr("regolithd.daemon.control.client._connected", forbidden)
        assert "usermod -aG regolithd" in str(error := await failure())
        assert error.exit_status == 77

    gone = await asyncio.start_unix_server(lambda _, writer: writer.close(), path)
    async with gone, control_connection(path) as daemon:
        daemon.send(StatusRequest())
        with pytest.raises(ControlError, match="it was stopped, or it failed"):
            await daemon.reply()
