"""`regolithd traverse` on a vcan bus, and every event that must stop the wheels.

Virtual rover, daemon and command are separate processes. Wheel speeds are read from the bus, not from the daemon.
"""

from __future__ import annotations

import re
import signal
import struct
import time
from typing import TYPE_CHECKING

import can
import pytest
from stack import CHANNEL, Stack, until

if TYPE_CHECKING:
    import subprocess
    from collections.abc import Callable, Iterator

pytestmark = [pytest.mark.vcan, pytest.mark.timeout(240)]
MOTORS = range(1, 7)
FAST = ("--distance", "50", "--speed", "0.05")
WHEEL_rpm = 0.05 / 0.075 * 1400 * 60 / 6.283185307  # at the motor


class Wheels:
    """State of the six motor controllers from their TPDO 1 (statusword, current, velocity) and EMCY messages."""

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus
        self.emergencies: list[tuple[int, int]] = []
        self.latest: dict[int, int] = {}

    def listen(self, seconds: float = 0.3) -> None:
        """Receive frames for this time [s], or until none comes."""
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
        """Return whether all wheels turn at the speed of the traverse."""
        self.listen()
        return len(self.latest) == 6 and all(
            abs(speed - WHEEL_rpm) < 0.02 * WHEEL_rpm for speed in self.latest.values()
        )

    def stand(self, nodes: Callable[[int], bool] = lambda _: True) -> bool:
        """Return whether these nodes (default: all) report a speed of 0 now."""
        self.latest.clear()
        self.listen()
        return bool(self.latest) and not any(speed for node, speed in self.latest.items() if nodes(node))

    def heartbeat_missed(self) -> set[int]:
        """Return the drives that have sent EMCY 0x8130 (heartbeat error)."""
        self.listen()
        return {node for node, code in self.emergencies if code == 0x8130}

    def at_rest(self) -> bool:
        """Return whether all six have velocity 0 (0x606C), read by SDO because there may be no SYNC.

        Pending frames are received first: the socket's full buffer would drop the answer.
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


@pytest.fixture
def stack(stack: Stack) -> Stack:
    """The module's stack, with a daemon that has booted every node."""
    stack.recover()
    return stack


@pytest.fixture
def wheels() -> Iterator[Wheels]:
    """The wheels' state from the bus."""
    with can.Bus(CHANNEL, interface="socketcan") as bus:
        yield Wheels(bus)


def traverse(stack: Stack, *options: str) -> subprocess.Popen[str]:
    """Start `regolithd traverse`."""
    return stack.spawn("traverse", "traverse", "--config", str(stack.configuration), *options)


@pytest.fixture
def driving(stack: Stack, wheels: Wheels) -> subprocess.Popen[str]:
    """A running traverse, all wheels turning."""
    process = traverse(stack, *FAST)
    until(wheels.turn, lambda: f"the wheels turn: {stack.output('traverse')}")
    return process


def test_a_traverse_takes_its_time_and_stops_clean(stack: Stack, wheels: Wheels) -> None:
    """A traverse ends with status 0 after distance / speed, prints time and measured distance, and causes no EMCY."""
    began = time.monotonic()
    process = stack.spawn(
        "traverse", "traverse", "--config", str(stack.configuration), "--distance", "0.2", "--speed", "0.05"
    )
    until(wheels.turn, lambda: f"the wheels turn: {stack.output('traverse')}")
    assert process.wait(60) == 0, stack.output("traverse")
    assert time.monotonic() - began >= 4.0
    told = re.search(r"Finished after 4\.000 s, (0\.\d+) m turned", stack.output("traverse"))
    assert told is not None, stack.output("traverse")
    assert float(told[1]) == pytest.approx(0.2, abs=0.05 / stack.rate_Hz + 0.005)  # one SYNC period is not seen
    until(wheels.stand, "the wheels stand")
    assert wheels.emergencies == []


@pytest.mark.parametrize("key", [signal.SIGINT, signal.SIGTSTP], ids=["Ctrl-C", "Ctrl-Z"])
def test_a_key_stops_the_wheels(
    stack: Stack, wheels: Wheels, driving: subprocess.Popen[str], key: signal.Signals
) -> None:
    """Ctrl-C and Ctrl-Z quick-stop the wheels, and the command ends with status 130."""
    driving.send_signal(key)
    assert driving.wait(60) == 130, stack.output("traverse")
    assert "Quick-stopped after" in stack.output("traverse")
    until(wheels.stand, "the wheels stand")
    assert stack.ready()


def test_the_wheels_stop_when_the_command_is_killed(
    stack: Stack, wheels: Wheels, driving: subprocess.Popen[str]
) -> None:
    """The daemon stops the wheels when the command's connection closes, and accepts the next traverse."""
    driving.kill()
    until(wheels.stand, "the wheels stand")
    until(lambda: stack.ask({"command": "status"})["traverse"] is None, "the traverse is over")
    following = stack.spawn(
        "traverse", "traverse", "--config", str(stack.configuration), "--distance", "0.05", "--speed", "0.05"
    )
    assert following.wait(60) == 0, stack.output("traverse")


def test_a_lost_node_stops_all_others(stack: Stack, wheels: Wheels, driving: subprocess.Popen[str]) -> None:
    """A load cell without power ends the traverse, the command names the node, and no new traverse is accepted."""
    stack.inject_fault("off 13")
    assert driving.wait(60) == 1, stack.output("traverse")
    assert "node 13" in stack.output("traverse")
    until(wheels.stand, "the wheels stand")
    assert traverse(stack, *FAST).wait(60) == 1
    assert "load-cell 13 is " in stack.output("traverse")
    stack.inject_fault("on 13")
    until(stack.ready, "the node is back")


def test_the_drives_stop_by_themselves_when_the_daemon_dies(
    stack: Stack, wheels: Wheels, driving: subprocess.Popen[str]
) -> None:
    """Each drive misses the daemon's heartbeat (0x1016), sends EMCY 0x8130 and stops."""
    stack.processes["daemon"].kill()
    until(lambda: wheels.heartbeat_missed() == {*MOTORS}, "every drive has missed the daemon's heartbeat")
    until(wheels.at_rest, "all six wheels stand")
    assert driving.wait(60) == 69, stack.output("traverse")
    assert "it was stopped, or it failed" in stack.output("traverse")


def test_stopping_the_daemon_stops_the_wheels_first(
    stack: Stack, wheels: Wheels, driving: subprocess.Popen[str]
) -> None:
    """After SIGTERM the daemon stops the wheels before it ends, and no drive misses a heartbeat."""
    assert stack.stop("daemon") == 0, stack.output("daemon")
    assert wheels.at_rest()
    wheels.listen()
    assert driving.wait(60) in {1, 69}, stack.output("traverse")
    assert not {code for _, code in wheels.emergencies}


def test_another_process_may_stop_the_traverse(stack: Stack, wheels: Wheels, driving: subprocess.Popen[str]) -> None:
    """`regolithd stop` ends the traverse with the drives' ramp."""
    stopped = stack.spawn("stop", "stop", "--config", str(stack.configuration))
    assert stopped.wait(60) == 0, stack.output("stop")
    assert driving.wait(60) == 1
    assert "Stopped after" in stack.output("traverse")
    until(wheels.stand, "the wheels stand")
