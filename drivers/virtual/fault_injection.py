"""Fault injection into virtual nodes by commands: one line of text, one answer.

    off 3                     node 3 loses its power
    on 3                      node 3 is powered again
    emcy 12 0x5000            load cell 12 reports a hardware error, until `emcy 12 0`
    identity 4 product 0x999  node 4 reports another product code from now on
    silent 11                 node 11 sends its heartbeat, but no PDOs
    clear all                 all faults end

A command that cannot be done is answered by a line that starts with `error:` and changes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.drivers.devices.motor_controller import VirtualMotorController
from regolithd.drivers.virtual.faults import Faults
from regolithd.drivers.virtual.node import VirtualNmtState

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from regolithd.drivers.virtual.node import VirtualNode

_IDENTITY = {"vendor": 1, "product": 2, "revision": 3, "serial": 4}


class FaultCommandError(ValueError):
    """A command that is unknown or incomplete."""


@dataclass(frozen=True, slots=True)
class _Command:
    """A command: `act` executes it on one node, given its arguments and the time (ns)."""

    usage: str
    meaning: str
    act: Callable[[VirtualNode, list[str], int], None]


def _number(words: list[str], place: int = 0) -> int:
    try:
        return int(words[place], 0)
    except (IndexError, ValueError) as error:
        given = f"not {words[place]!r}" if place < len(words) else "and none was given"
        raise FaultCommandError(f"a number is expected, {given}") from error


def _flag(name: str) -> Callable[[VirtualNode, list[str], int], None]:
    def act(node: VirtualNode, words: list[str], now: int) -> None:
        del words, now
        setattr(node.faults, name, True)

    return act


def _value(name: str, scale: int = 1) -> Callable[[VirtualNode, list[str], int], None]:
    def act(node: VirtualNode, words: list[str], now: int) -> None:
        del now
        setattr(node.faults, name, _number(words) * scale)

    return act


def _identity(node: VirtualNode, words: list[str], now: int) -> None:
    del now
    if not words or words[0] not in _IDENTITY:
        raise FaultCommandError(f"which entry of the identity? One of {', '.join(_IDENTITY)}")
    node.override_identity(_IDENTITY[words[0]], _number(words, 1))


def _drive_fault(node: VirtualNode, words: list[str], now: int) -> None:
    del now
    if not isinstance(node.device, VirtualMotorController):
        raise FaultCommandError(f"node {node.id} is not a drive")
    node.device.fault(_number(words))


def _leave(node: VirtualNode, words: list[str], now: int) -> None:
    del words, now
    node.enter(VirtualNmtState.PRE_OPERATIONAL)


def _clear(node: VirtualNode, words: list[str], now: int) -> None:
    del words, now
    node.faults = Faults()
    node.override_identity(0, 0)
    node.report(0)


COMMANDS = {
    "off": _Command("off N", "lose power", lambda node, _words, _now: node.power_off()),
    "on": _Command("on N", "be powered again", lambda node, _words, now: node.power_on(now)),
    "reset": _Command(
        "reset N", "restart by itself, as after a brown-out", lambda node, _words, now: node.restart(now)
    ),
    "leave": _Command("leave N", "go to pre-operational by itself", _leave),
    "emcy": _Command(
        "emcy N CODE", "report an error; 0 ends all", lambda node, words, _now: node.report(_number(words))
    ),
    "fault": _Command("fault N CODE", "the drive faults: EMCY, stop, until fault reset", _drive_fault),
    "identity": _Command(
        "identity N vendor|product|revision|serial VALUE", "report another identity (0x1018)", _identity
    ),
    "silent": _Command("silent N", "send no PDO, heartbeat goes on", _flag("silent")),
    "frozen": _Command("frozen N", "repeat the last values", _flag("frozen")),
    "deaf": _Command("deaf N", "ignore RPDOs", _flag("deaf")),
    "slow": _Command("slow N MS", "send PDOs this much later", _value("delay_ns", 1_000_000)),
    "short": _Command("short N BYTES", "send PDOs this many bytes too short", _value("missing_bytes")),
    "status": _Command("status N BITS", "set bits of its status object (load cell: 0x6150)", _value("status")),
    "no-boot-up": _Command("no-boot-up N", "never boot up after the next reset", _flag("no_boot_up")),
    "no-heartbeat": _Command("no-heartbeat N", "send no heartbeat", _flag("no_heartbeat")),
    "no-sdo": _Command("no-sdo N", "answer no SDO", _flag("no_sdo")),
    "refuse": _Command(
        "refuse N INDEX", "abort writing an object", lambda node, words, _now: node.faults.refused.add(_number(words))
    ),
    "forget": _Command(
        "forget N INDEX",
        "acknowledge writing an object, keep its value",
        lambda node, words, _now: node.faults.forgotten.add(_number(words)),
    ),
    "clear": _Command("clear N", "undo all of the above but off", _clear),
}


def inject_fault(nodes: Mapping[int, VirtualNode], line: str, now: int) -> str:
    """Execute a command and return its answer; `N` is a node-ID or `all`."""
    words = line.split()
    if not words:
        return ""
    if words[0] == "help":
        return "\n".join(f"{each.usage:46} {each.meaning}" for each in COMMANDS.values())
    try:
        command = _find(words[0])
        for node in _chosen(nodes, words[1:]):
            command.act(node, words[2:], now)
    except FaultCommandError as error:
        return f"error: {error}"
    return "ok"


def _find(name: str) -> _Command:
    if name not in COMMANDS:
        raise FaultCommandError(f"there is no command {name!r}; `help` lists them")
    return COMMANDS[name]


def _chosen(nodes: Mapping[int, VirtualNode], words: list[str]) -> list[VirtualNode]:
    if words[:1] == ["all"]:
        return list(nodes.values())
    number = _number(words)
    if number not in nodes:
        raise FaultCommandError(f"there is no node {number}; there are {', '.join(map(str, nodes))}")
    return [nodes[number]]
