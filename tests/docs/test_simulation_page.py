"""The page about simulations of one's own lists everything that may be stated, and its code runs."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from regolithd.calibration.mismatch import compare
from regolithd.calibration.mismatch.data.recording import TIME_UNITS_S, read_recording
from regolithd.calibration.mismatch.data.slow_channels import filled_between
from regolithd.calibration.mismatch.simulation.checked import checked
from regolithd.calibration.mismatch.simulation.checked_candidate import STATED
from regolithd.calibration.mismatch.simulation.simulation import Simulation

if TYPE_CHECKING:
    from numpy.typing import NDArray

PAGE = (Path(__file__).resolve().parents[2] / "docs/how-to/simulation.md").read_text(encoding="utf-8")


def test_the_page_lists_every_attribute_and_method() -> None:
    """Nothing has to be looked up in the source."""
    methods = {name for name, value in vars(Simulation).items() if inspect.isroutine(value) and name[0] != "_"}
    listed = set(re.findall(r"^\| `(\w+)", PAGE, flags=re.MULTILINE))
    assert set(Simulation.__annotations__) | methods | set(STATED) | {"coefficients", "columns"} <= listed


def test_the_page_names_every_unit_of_time() -> None:
    """A column of time has its unit in its name."""
    assert all(f"`{name}`" in PAGE for name in TIME_UNITS_S)


def test_the_class_on_the_page_predicts_the_recording_on_the_page(tmp_path: Path) -> None:
    """Text names of axes and a slower sensor are read as the page says."""
    blocks = re.findall(r"```(\w+)\n(.*?)```", PAGE, flags=re.DOTALL)
    python = next(text for kind, text in blocks if kind == "python")
    table = next(text for kind, text in blocks if kind == "text" and text.startswith("t_s"))
    (tmp_path / "monday.csv").write_text(table)
    names: dict[str, type[Simulation]] = {}
    exec(python, names)
    joint = checked(names["Joint"]())
    recording = read_recording(tmp_path / "monday.csv", unit=joint.wheel_column)
    assert recording.wheels == ("elbow", "wrist")
    prepared = joint.prepare(filled_between(recording, joint.channel, joint.between_readings))
    inputs = {**prepared.channels, "t_s": np.zeros(prepared.shape)}
    np.testing.assert_allclose(joint.predict(inputs, {"inertia_kg_m2": 0.5}), [[1.55, 0.45], [1.5, np.nan]])
    assert set(joint.covariates(inputs)) == {"wheel_speed", "temperature"}


@pytest.fixture(scope="module")
def fans() -> dict[str, Any]:
    """What the page's whole example defines."""
    blocks = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    names: dict[str, Any] = {}
    exec(next(text for text in blocks if "class Fans" in text), names)
    return names


def duct(simulation: Simulation) -> dict[str, NDArray[Any]]:
    """Return two runs of two fans: a filter that clogs, and a bearing of the supply fan that drags with speed."""
    rng, count, names = np.random.default_rng(1), 700, np.array(["exhaust", "supply"])
    run = np.repeat([0, 1], count // 2)
    inputs = {
        "t_s": np.tile(np.arange(count // 2, dtype=float), 2),
        "run": run,
        "bearing_degC": 20 + 25 * (1 - np.exp(-np.arange(count) / 400)),
    }
    inputs = {name: np.repeat(values[:, None], 2, axis=1) for name, values in inputs.items()}
    speed = np.repeat(rng.uniform(500, 1500, (count // 35, 2)), 35, axis=0)
    inputs |= {"speed_rpm": speed, "damper_pct": np.repeat(rng.uniform(35, 100, (count // 70, 2)), 70, axis=0)}
    values = {name: prior.value for name, prior in simulation.parameters.items()}
    predicted: Any = simulation.predict(inputs, values)
    flow = simulation.flow(inputs, values)  # type: ignore[attr-defined]
    clogged = 0.003 * flow**2 * np.arange(count)[:, None]
    drag = speed / 1000 * [0.0, 0.15]
    inputs["bearing_degC"][np.arange(count) % 10 > 0] = np.nan
    table = inputs | {
        "rise_Pa": predicted["rise_Pa"] - clogged + rng.normal(0, 4, flow.shape),
        "motor_current_A": predicted["motor_current_A"] + drag + rng.normal(0, 0.05, flow.shape),
    }
    return {"fan": np.tile(names, count), **{name: each.ravel() for name, each in table.items()}}


def test_the_whole_example_names_what_its_recording_conceals(fans: dict[str, Any]) -> None:
    """Its own effect in one column and one of the library in the other, each on its fans, in its units."""
    simulation = fans["Fans"]()
    answer = compare(duct(simulation), simulation).answer
    assert answer.verdict == "missing-physics"
    found = {(effect.name, effect.channel): effect for effect in answer.effects}
    assert set(found) == {("filter-clogging", "rise_Pa"), ("viscous-friction", "motor_current_A")}
    clogging, friction = found["filter-clogging", "rise_Pa"], found["viscous-friction", "motor_current_A"]
    assert (clogging.wheels, friction.wheels) == (("exhaust", "supply"), ("supply",))
    assert clogging.statement.startswith("A filter whose resistance grows with time, on both fans: ")
    loss = clogging.parameters["loss_per_second"]
    assert loss.low < -0.003 < loss.high
    assert loss.unit == "Pa s⁵/m⁶"
    assert friction.parameters["viscous_coefficient"].unit == "A/rpm^p"
    told = [*answer.notes, *(one.experiment for one in answer.indistinguishable)]
    assert any("without the channel rise_Pa: filter-clogging" in note for note in told)
    assert not any("to and fro" in text or "both ways" in text for text in told)
