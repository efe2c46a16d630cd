"""A traverse over a real bus, commanded as a person does it; and everything that must stop the wheels.

Virtual rover, daemon and command are processes of their own. The wheels are watched on the bus, never by the daemon.
"""

from __future__ import annotations

import signal
import struct
import time
from typing import TYPE_CHECKING

import can
import pytest
from stack import Stack, stack_on, until

if TYPE_CHECKING:
    import subprocess
    from collections.abc import Callable, Iterator

pytestmark = [pytest.mark.vcan, pytest.mark.timeout(240)]
CHANNEL = "vcan0"
MOTORS = range(1, 7)
FAST = ("--distance", "50", "--speed", "0.05")
WHEEL_rpm = 0.05 / 0.075 * 1400 * 60 / 6.283185307  # at the motor


class Wheels:
    """What the six motor controllers say on the bus: 0x180 + node is statusword, current and velocity."""

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus
        self.emergencies: list[tuple[int, int]] = []
        self.latest: dict[int, int] = {}

    def listen(self, seconds: float = 0.3) -> None:
        """Take what comes."""
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0:
            message = self.bus.recv(left)
            if message is None:
                return
            node = message.arbitration_id & 0x7F
            if message.arbitration_id - node == 0x180 and node in MOTORS:
                self.latest[node] = struct.unpack_from("<i", message.data, 4)[0]
            elif message.arbitration_id - node == 0x080 and node in MOTORS:
                self.emergencies.append((node, struct.unpack_from("<H", message.data)[0]))

    def turn(self) -> bool:
        """Whether all turn at the speed of the traverse."""
        self.listen()
        return len(self.latest) == 6 and all(
            abs(speed - WHEEL_rpm) < 0.02 * WHEEL_rpm for speed in self.latest.values()
        )

    def stand(self, nodes: Callable[[int], bool] = lambda _: True) -> bool:
        """Whether these nodes, all unless told otherwise, have just said that they stand."""
        self.latest.clear()
        self.listen()
        return bool(self.latest) and not any(speed for node, speed in self.latest.items() if nodes(node))

    def heartbeat_missed(self) -> set[int]:
        """Return the drives that have said that they no longer hear their master."""
        self.listen()
        return {node for node, code in self.emergencies if code == 0x8130}

    def at_rest(self) -> bool:
        """Whether all six say, asked by SDO as no SYNC may be produced any more, that they do not turn (0x606C).

        What has come meanwhile is taken first: an answer finds no place in a socket that nobody has read for long.
        """
        self.listen(2.0)
        return not any(self._velocity_rpm(node) for node in MOTORS)

    def _velocity_rpm(self, node: int) -> int:
        request = struct.pack("<BHB4x", 0x40, 0x606C, 0)
        self.bus.send(can.Message(arbitration_id=0x600 + node, data=request, is_extended_id=False))
        deadline = time.monotonic() + 30
        while time.monotonic() < deadline:
            message = self.bus.recv(1)
            if message and message.arbitration_id == 0x580 + node and message.data[1:4] == request[1:4]:
                return int(struct.unpack_from("<i", message.data, 4)[0])
        raise AssertionError(f"node {node} does not answer")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    """A broker, a virtual rover and a daemon, for all tests of this file: a start takes long in the guest."""
    with stack_on(CHANNEL, tmp_path_factory.mktemp("stack")) as stack:
        yield stack


@pytest.fixture
def stack(whole: Stack) -> Stack:
    """The same, with a daemon that has booted every node."""
    whole.recover()
    return whole


@pytest.fixture
def wheels() -> Iterator[Wheels]:
    """The wheels, as the bus tells them."""
    with can.Bus(CHANNEL, interface="socketcan") as bus:
        yield Wheels(bus)


def traverse(stack: Stack, *options: str) -> subprocess.Popen[str]:
    """Command a traverse as a person does."""
    return stack.spawn("traverse", "traverse", "--config", str(stack.configuration), *options)


@pytest.fixture
def driving(stack: Stack, wheels: Wheels) -> subprocess.Popen[str]:
    """A traverse under way."""
    process = traverse(stack, *FAST)
    until(wheels.turn, lambda: f"the wheels turn: {stack.said('traverse')}")
    return process


def test_a_traverse_takes_its_time_and_stops_clean(stack: Stack, wheels: Wheels) -> None:
    """Exit status 0, what it was, and no emergency on the way."""
    began = time.monotonic()
    process = stack.spawn(
        "traverse", "traverse", "--config", str(stack.configuration), "--distance", "0.2", "--speed", "0.05"
    )
    until(wheels.turn, lambda: f"the wheels turn: {stack.said('traverse')}")
    assert process.wait(60) == 0, stack.said("traverse")
    assert time.monotonic() - began >= 4.0
    assert "Finished after 4.000 s, 0.200 m turned" in stack.said("traverse")
    until(wheels.stand, "the wheels stand")
    assert wheels.emergencies == []


@pytest.mark.parametrize("key", [signal.SIGINT, signal.SIGTSTP], ids=["Ctrl-C", "Ctrl-Z"])
def test_a_key_stops_the_wheels(
    stack: Stack, wheels: Wheels, driving: subprocess.Popen[str], key: signal.Signals
) -> None:
    """At once, and the command says so with a shell's status for it; one that sleeps could not be told to stop."""
    driving.send_signal(key)
    assert driving.wait(60) == 130, stack.said("traverse")
    assert "Quick-stopped after" in stack.said("traverse")
    until(wheels.stand, "the wheels stand")
    assert stack.ready()


def test_the_wheels_stop_when_the_command_is_killed(
    stack: Stack, wheels: Wheels, driving: subprocess.Popen[str]
) -> None:
    """Nobody is left to say stop, and the daemon notices; the next traverse may begin."""
    driving.kill()
    until(wheels.stand, "the wheels stand")
    until(lambda: stack.ask({"command": "status"})["traverse"] is None, "the traverse is over")
    again = stack.spawn(
        "traverse", "traverse", "--config", str(stack.configuration), "--distance", "0.05", "--speed", "0.05"
    )
    assert again.wait(60) == 0, stack.said("traverse")


def test_a_lost_node_stops_all_others(stack: Stack, wheels: Wheels, driving: subprocess.Popen[str]) -> None:
    """A load cell without power ends it, as nobody knows any more what that wheel carries; the command says why."""
    stack.tell_rover("off 13")
    assert driving.wait(60) == 1, stack.said("traverse")
    assert "node 13" in stack.said("traverse")
    until(wheels.stand, "the wheels stand")
    assert traverse(stack, *FAST).wait(60) == 1
    assert "load-cell 13 is " in stack.said("traverse")
    stack.tell_rover("on 13")
    until(stack.ready, "the node is back")


def test_the_drives_stop_by_themselves_when_the_daemon_dies(
    stack: Stack, wheels: Wheels, driving: subprocess.Popen[str]
) -> None:
    """Their own heartbeat consumers (0x1016) miss it; each says so with EMCY 0x8130, and nobody has commanded it."""
    stack.processes["daemon"].kill()
    until(lambda: wheels.heartbeat_missed() == {*MOTORS}, "every drive has missed the daemon's heartbeat")
    until(wheels.at_rest, "all six wheels stand")
    assert driving.wait(60) == 69, stack.said("traverse")
    assert "it was stopped, or it died" in stack.said("traverse")


def test_stopping_the_daemon_stops_the_wheels_first(
    stack: Stack, wheels: Wheels, driving: subprocess.Popen[str]
) -> None:
    """As systemd stops it; no drive has to help itself."""
    assert stack.stop("daemon") == 0, stack.said("daemon")
    assert wheels.at_rest()
    wheels.listen()
    assert driving.wait(60) in {1, 69}, stack.said("traverse")
    assert not {code for _, code in wheels.emergencies}


def test_somebody_else_may_stop_it(stack: Stack, wheels: Wheels, driving: subprocess.Popen[str]) -> None:
    """`regolithd stop`, with the drives' ramp."""
    stopped = stack.spawn("stop", "stop", "--config", str(stack.configuration))
    assert stopped.wait(60) == 0, stack.said("stop")
    assert driving.wait(60) == 1
    assert "Stopped after" in stack.said("traverse")
    until(wheels.stand, "the wheels stand")
