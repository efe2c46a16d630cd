"""An input whose logger holds its readings: late by half a period on average, told with its cure; or not late."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.inference.unexplained.dynamics import notes_on_held_inputs

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.answer import Answer

Array = NDArray[np.float64]
COUNT = 1500
HELD = "consistency_pct"


class Refiner(Simulation):
    """The power of a pulp refiner: more with the fibre that flows through, less with its gap."""

    channel, unit = "power_kW", "kW"
    inputs = ("flow_L_s", "gap_mm", HELD)
    parameters: ClassVar = {"idle_kW": Prior(120.0, 6.0, "kW"), "by_fibre_kW": Prior(30.0, 1.0, "kW")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the power."""
        fibre = inputs["flow_L_s"] * inputs[HELD] / 4
        return values["idle_kW"] + values["by_fibre_kW"] * fibre / (0.2 + inputs["gap_mm"])

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the inputs."""
        return {name: inputs[name] for name in self.inputs}


def wandering(random: np.random.Generator, memory_s: float) -> Array:
    """Return a course of unit variance with a memory of so many readings."""
    kept = np.exp(-1 / memory_s)
    return np.asarray(lfilter([np.sqrt(1 - kept**2)], [1, -kept], random.standard_normal(COUNT + 2000))[2000:])


def recorded(seed: int, varies_pct: float, noise_kW: float, rows: int) -> dict[str, Array]:
    """Return a recording whose consistency varies by so much, and keeps each of its readings for so many rows."""
    random = np.random.default_rng(seed)
    true = {
        "flow_L_s": 8 + 1.2 * wandering(random, 40),
        "gap_mm": np.repeat(random.uniform(0.2, 0.6, COUNT // 100), 100),
        HELD: 4 + varies_pct * wandering(random, 60),
    }
    power = Refiner().predict(true, {"idle_kW": random.normal(120, 6), "by_fibre_kW": random.normal(30, 1)})
    noise = noise_kW * (0.7 * random.standard_normal(COUNT) + 0.7 * wandering(random, 8))
    held = true[HELD][np.arange(COUNT) // rows * rows]
    return {"t_s": np.arange(COUNT, dtype=float), **true, HELD: held, "power_kW": power + noise}


def answer_to(columns: Mapping[str, Array]) -> Answer:
    """Return the answer to a recording."""
    return compare(columns, Refiner()).answer


def test_a_delay_by_holding_is_told_with_its_cure() -> None:
    """The delay has its name, a note says that it may be the logger's, and without the repetitions nothing is late."""
    columns = recorded(1, varies_pct=0.25, noise_kW=12, rows=20)
    answer = answer_to(columns)
    assert [effect.name for effect in answer.effects] == ["sensor-delay"]
    assert any(f"{HELD} repeats each of its readings for 20 rows" in note for note in answer.notes)
    once = np.where(np.arange(COUNT) % 20 == 0, columns[HELD], np.nan)
    assert answer_to({**columns, HELD: once}).verdict == "consistent"


@pytest.mark.parametrize(("delay_s", "told"), [(10.0, True), (16.0, True), (30.0, False), (1.5, False)])
def test_a_delay_that_holding_does_not_make_has_no_note(delay_s: float, told: bool) -> None:
    """Readings that are kept for 20 s are 10 s old on average: a delay of 30 s has another cause."""
    recording = from_columns(recorded(1, varies_pct=0.25, noise_kW=12, rows=20))
    assert bool(notes_on_held_inputs(recording, {HELD: delay_s}, {})) is told
    assert not notes_on_held_inputs(recording, {"flow_L_s": delay_s}, {})


def test_a_delay_by_holding_as_the_simulation_asks_is_told_with_its_cure() -> None:
    """Readings with blanks between them are held where `between_readings` says so, and on straight lines elsewhere."""
    columns = recorded(1, varies_pct=0.25, noise_kW=12, rows=20)
    recording = from_columns({**columns, HELD: np.where(np.arange(COUNT) % 20 == 0, columns[HELD], np.nan)})
    (note,) = notes_on_held_inputs(recording, {HELD: 10.0}, {HELD: "hold"})
    assert "is read every 20 rows and held in between" in note
    assert not notes_on_held_inputs(recording, {HELD: 30.0}, {HELD: "hold"})
    assert not notes_on_held_inputs(recording, {HELD: 10.0}, {})


def test_a_refused_delay_puts_nothing_on_time() -> None:
    """A delay that the search finds and held-out readings refuse costs no reading: the input is compared as it was."""
    answer = answer_to(recorded(6, varies_pct=0.1, noise_kW=20, rows=40))
    assert not answer.effects
    assert not answer.left_out
