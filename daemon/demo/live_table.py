"""The demo's live table, filled from MQTT messages alone."""

from __future__ import annotations

import json
import math
import textwrap
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from regolithd.calibration.posterior.window import INTERVAL_S
from regolithd.daemon.demo.interval_bar import SCALES, interval_bar

if TYPE_CHECKING:
    from rich.console import RenderableType

    from regolithd.daemon.simulator.virtual_rover import VirtualWorld

PLACES = ("front left", "front right", "middle left", "middle right", "rear left", "rear right")
HISTORY = 12
ALARM_WIDTH = 80
BLOCKS = "▁▂▃▄▅▆▇█"
LEGEND = "outside: load W, slip i or current I is not in the network's training range"
SYMBOLS = {"load_N": "W", "slip": "i", "motor_current_A": "I", "wheel_torque_Nm": "T", "wheel_speed_rad_s": "ω"}


@dataclass(slots=True)
class LiveTable:
    """The newest message of each wheel, the recent torques, posterior and alarms, and the number of messages.

    `world` is the simulator, which alone knows the true soil; `paper` adds the paper's network, as a comparison.
    """

    prefix: str
    world: VirtualWorld | None = None
    paper: bool = False
    wheels: dict[int, dict[str, Any]] = field(default_factory=dict)
    torque: dict[int, deque[float]] = field(default_factory=dict)
    state: str = "offline"
    nodes: int = 0
    messages: int = 0
    snapshots: int = 0
    posterior: dict[str, Any] | None = None
    alarms: dict[str, str] = field(default_factory=dict)

    def take(self, topic: str, payload: bytes) -> None:
        """Take in one message."""
        self.messages += 1
        match topic.removeprefix(self.prefix + "/").split("/"):
            case ["wheel", number]:
                self._wheel(int(number), json.loads(payload))
            case ["snapshot"]:
                self.snapshots += 1
            case ["state"]:
                self.state = json.loads(payload)["state"]
            case ["posterior"]:
                self.posterior = json.loads(payload)
            case ["alarm", name]:
                self._alarm(name, json.loads(payload))

    def _wheel(self, number: int, message: dict[str, Any]) -> None:
        self.wheels[number] = message
        torque = message["smoothed_torque_Nm"]
        if torque is not None:
            self.torque.setdefault(number, deque(maxlen=HISTORY)).append(torque)

    def _alarm(self, name: str, message: dict[str, Any]) -> None:
        self.alarms.pop(name, None)
        if message["active"]:
            self.alarms[name] = message["text"]

    def render(self) -> RenderableType:
        """Return the table of the wheels, the posterior, and a line with state and alarms."""
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 2, 0, 0))
        table.add_column("wheel", no_wrap=True)
        for name in ("load\nN", "slip\n%", "torque\nN·m"):
            table.add_column(name, justify="right", no_wrap=True)
        table.add_column("", no_wrap=True)
        table.add_column("true soil\n(simulator)", no_wrap=True)
        if self.paper:
            for name in ("paper: c\nkPa", "φ\n°"):
                table.add_column(name, justify="right", no_wrap=True)
            table.add_column("\ninputs", no_wrap=True)
        top = max([0.1, *(max(values) for values in self.torque.values() if values)])
        for wheel in range(1, 7):
            table.add_row(*self._row(wheel, top))
        legend = [Text(LEGEND, style="dim")] if self.paper else []
        return Group(table, *legend, Text(), *self._posterior_lines(), Text(), *self._alarm_lines(), self._footer())

    def _posterior_lines(self) -> list[Text]:
        """Return title and one interval bar for each quantity of the posterior."""
        if self.posterior is None:
            return [Text("posterior of all six wheels: not enough data yet", style="dim"), *[Text()] * len(SCALES)]
        seconds = self.posterior["instants"] * INTERVAL_S
        title = Text.assemble(
            ("posterior of all six wheels over the last ", "dim"), f"{seconds:g} s", (" (90 % interval)", "dim")
        )
        return [title, *(interval_bar(scale, self.posterior[scale.key]) for scale in SCALES)]

    def _row(self, wheel: int, top: float) -> tuple[RenderableType, ...]:
        name = Text.assemble((f"{wheel} ", "bold"), (PLACES[wheel - 1], "dim"))
        message = self.wheels.get(wheel)
        if message is None:
            return (name, *[Text("–", style="dim")] * 3, "", Text("waiting", style="dim"), *["–"] * 3 * self.paper)
        history = Text(sparkline(self.torque.get(wheel, ()), top).ljust(HISTORY), style="cyan")
        return (
            name,
            _number(message["smoothed_load_N"], 1),
            _number(message["slip"], 1, 100),
            _number(message["smoothed_torque_Nm"], 2, style="bold cyan"),
            history,
            self._soil(wheel),
            *(_paper_cells(message) if self.paper else ()),
        )

    def _soil(self, wheel: int) -> Text:
        """Return the true soil under a wheel; the second one that was driven on is marked."""
        truth = self.world.truth if self.world is not None else None
        if truth is None or self.world is None:
            return Text("–", style="dim")
        soil = truth.soils[wheel - 1]
        first = self.world.scenario.ground.stretches[0].name
        return Text(soil, style="dim" if soil == first else "bold yellow")

    def _alarm_lines(self) -> list[Text]:
        """Return the first alarm, in four lines, so that the picture does not move."""
        lines = [Text()] * 4
        if self.alarms:
            text = "▲ ALARM " + next(iter(self.alarms.values())).replace(" %", "\N{NO-BREAK SPACE}%")
            lines = [*(Text(line, style="bold red") for line in textwrap.wrap(text, ALARM_WIDTH)), *lines][:4]
        return lines

    def _footer(self) -> Text:
        style = "green" if self.state == "online" else "red"
        text = Text.assemble(
            ("● ", style), (f"{self.prefix} {self.state}", style), (f" · {self.messages} messages", "dim")
        )
        text.append("" if self.alarms else " · no alarm", style="dim")
        return text


def sparkline(values: Any, top: float) -> str:  # noqa: ANN401  # any numbers in a row
    """Return values between 0 and `top` as a row of block characters."""
    return "".join(BLOCKS[min(len(BLOCKS) - 1, max(0, int(value / top * len(BLOCKS))))] for value in values)


def _paper_cells(message: dict[str, Any]) -> tuple[Text, Text, Text]:
    """Return cohesion and friction angle of the paper's network, and whether its inputs lie in the training range."""
    angle = message["friction_angle_rad"]
    colour = "green" if message["valid"] and not message["outside_training_range"] else "yellow"
    return (
        _number(message["cohesion_Pa"], 2, 1e-3, style=colour),
        _number(math.degrees(angle) if angle is not None else None, 1, style=colour),
        _verdict(message),
    )


def _number(value: float | None, digits: int, factor: float = 1.0, style: str = "") -> Text:
    if value is None:
        return Text("–", style="dim")
    return Text(f"{value * factor:.{digits}f}", style=style)


def _verdict(message: dict[str, Any]) -> Text:
    if not message["measured"]:
        return Text("not measured", style="red")
    if not message["valid"]:
        return Text("standing still" if message["slip_source"] == "none" else "no estimate", style="dim")
    if outside := message["outside_training_range"]:
        return Text(f"{', '.join(SYMBOLS.get(name, name) for name in outside)} outside", style="yellow")
    return Text("valid", style="green")
