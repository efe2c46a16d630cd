"""A layout of plots for the recordings, which Lichtblick and Foxglove import ("Import from file").

`mosaic` of their format: a tree whose leaves are panels and whose inner nodes say `row` or `column`.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from regolithd.daemon.recording.content import ESTIMATE, SNAPSHOT, six

if TYPE_CHECKING:
    from pathlib import Path

NAME = "lichtblick-layout.json"
WHEELS = {
    "Load [N]": (SNAPSHOT, "load_N"),
    "Slip": (ESTIMATE, "slip"),
    "Wheel torque [N m]": (ESTIMATE, "smoothed_torque_Nm"),
    "Motor current [A]": (SNAPSHOT, "motor_current_A"),
}
"""Title → topic and name of a quantity of six wheels."""
SOIL = {
    "Cohesion [Pa]": "cohesion_Pa",
    "Friction angle [rad]": "friction_angle_rad",
    "Drawbar margin": "drawbar_margin",
}
LEVELS = ("low_90", "median", "high_90")
COLOURS = ("#d55e00", "#e69f00", "#0072b2", "#56b4e9", "#009e73", "#cc79a7")
"""Of Okabe and Ito: told apart with any colour vision. Front orange, middle blue, rear green and purple."""


def layout() -> dict[str, Any]:
    """Return the layout: on the left the soil's intervals, on the right what the wheels do."""
    soil = {f"Plot!{name}": _plot(title, _intervals(name)) for title, name in SOIL.items()}
    wheels = {f"Plot!{name}": _plot(title, _lines(topic, name)) for title, (topic, name) in WHEELS.items()}
    return {
        "configById": soil | wheels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {"first": _column(list(soil)), "second": _column(list(wheels)), "direction": "row"},
    }


def write_layout(folder: Path) -> None:
    """Write the layout beside the recordings, if it is not there yet."""
    path = folder / NAME
    if not path.exists():
        path.write_text(json.dumps(layout(), indent=1) + "\n", encoding="ascii")


def _plot(title: str, paths: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "title": title,
        "paths": [{"enabled": True, "timestampMethod": "receiveTime", **path} for path in paths],
        "xAxisVal": "timestamp",
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "showLegend": True,
        "legendDisplay": "left",
        "isSynced": True,
    }


def _intervals(name: str) -> list[dict[str, Any]]:
    colours = (COLOURS[3], COLOURS[2], COLOURS[3])
    return [
        {"value": f"{ESTIMATE}.posterior.{name}.{level}", "label": level, "color": colour}
        for level, colour in zip(LEVELS, colours, strict=True)
    ]


def _lines(topic: str, name: str) -> list[dict[str, Any]]:
    return [
        {"value": f"{topic}.{each}", "label": f"wheel {wheel}", "color": colour}
        for wheel, (each, colour) in enumerate(zip(six(name), COLOURS, strict=True), 1)
    ]


def _column(panels: list[str]) -> str | dict[str, Any]:
    """Return panels of the same height, one above the other."""
    if len(panels) == 1:
        return panels[0]
    share = 100 / len(panels)
    return {"first": panels[0], "second": _column(panels[1:]), "direction": "column", "splitPercentage": share}
