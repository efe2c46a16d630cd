"""Data that are handed on do not change: which classes are frozen, have slots, and are compared by value."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[1]
ROOMS = ("drivers", "daemon", "calibration/mismatch")
STATE = {
    *("BusCounters", "SyncCounters", "NetworkCounters", "SpoolCounters"),
    *("Faults", "EnabledPdo", "_Transfer", "Traverse", "LiveTable", "_PdoCount", "Backoff", "_Bucket", "_Flight"),
    *("Outbox", "_Scan", "_Pair", "_Rise", "FoundNode", "Replayed", "_Changes"),
}
"""Counters and running state of one owner: changed in place."""
BY_IDENTITY = {"Quantity", "Device", "LoopResult", "SimulatedDrive"}
"""Compared by identity although none of their fields is an array."""
ARRAYS = ("Array", "Mask", "NDArray")


def dataclasses_of(room: str) -> Iterator[tuple[str, ast.ClassDef, dict[str, bool]]]:
    """Yield each dataclass of a room: its place, its definition, and the options of its decorator."""
    for path in sorted((ROOT / room).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            for decorator in node.decorator_list if isinstance(node, ast.ClassDef) else ():
                if isinstance(decorator, ast.Call) and ast.unparse(decorator.func) == "dataclass":
                    options = {each.arg: ast.literal_eval(each.value) for each in decorator.keywords}
                    yield f"{path.relative_to(ROOT)}:{node.name}", node, options


def is_plain(node: ast.ClassDef) -> bool:
    """Return whether a class only lists fields and has no decorator: a dataclass that has lost it."""
    fields = [each for each in node.body if isinstance(each, ast.AnnAssign) and each.value is None]
    methods = [each for each in node.body if isinstance(each, ast.FunctionDef) and not each.decorator_list]
    return bool(fields) and not (node.decorator_list or node.bases or methods)


@pytest.mark.parametrize("room", ROOMS)
def test_a_dataclass_is_frozen_unless_it_is_state(room: str) -> None:
    """State is changed in place by one owner and listed here; all other data are frozen."""
    changed = {place for place, node, _ in dataclasses_of(room) if node.name in STATE}
    found = {place for place, _, options in dataclasses_of(room) if not options.get("frozen", False)}
    assert found == changed


@pytest.mark.parametrize("room", ROOMS[:2])
def test_a_dataclass_of_drivers_and_daemon_has_slots(room: str) -> None:
    """A misspelt attribute is an error, and an object takes less memory."""
    assert {place for place, _, options in dataclasses_of(room) if not options.get("slots")} == set()


@pytest.mark.parametrize("room", ROOMS[:2])
def test_a_dataclass_with_arrays_is_compared_by_identity(room: str) -> None:
    """`==` of two arrays is an array, whose truth value raises an error."""
    for place, node, options in dataclasses_of(room):
        fields = [ast.unparse(each.annotation) for each in node.body if isinstance(each, ast.AnnAssign)]
        by_identity = node.name in BY_IDENTITY or any(name in field for field in fields for name in ARRAYS)
        assert options.get("eq", True) == (not by_identity), place


def test_what_the_engine_computes_with_is_compared_by_identity() -> None:
    """Matrices of the regression are large: comparing them would be a mistake."""
    found = {node.name for _, node, options in dataclasses_of("calibration/mismatch") if not options.get("eq", True)}
    assert found == {
        "_Names",
        "_Pose",
        "InitialState",
        "FurtherColumns",
        "WienerFilter",
        "NoisyColumn",
        "_Courses",
        "_Products",
        "_InNoise",
        "_Spectra",
        "_Fitted",
        "_Drawn",
        "Addition",
        "Asked",
        "Bands",
        "TimedSpells",
        "Beside",
        "Responses",
        "Restart",
        "Unnamed",
        "HeldOutSquares",
        "Usual",
        "Simulated",
        "Linearisation",
        "Sandwich",
        "_LateSearch",
        "Late",
        "_Weighed",
        "_Readings",
        "StatedShare",
        "Step",
        "FaultyReadings",
        "InputDoubt",
        "DesignMatrix",
        "Ranges",
        "RangeSums",
        "NoiseModel",
        "LaggedSums",
        "NormalEquations",
        "Decision",
        "Inputs",
        "Intermittent",
        "Course",
        "ShapeProfile",
        "StatedEffect",
        "_Draws",
        *(
            "Found",
            "_Beside",
            "FoundTerm",
            "Sums",
            "_Columns",
            "_Compared",
            "FleetEquations",
            "FleetFit",
            "Place",
            "Summed",
            "Chooser",
            "Chosen",
        ),
        *("Decided", "_Search", "Start"),
        "AsRead",
        *("BetweenReadings", "Reliability", "MarkovChains", "SwitchingMean"),
        *("Gains", "JointPosterior", "Likelihood", "_Likelihood", "Drawn", "Information", "Apart", "KnownTogether"),
        *("NormalTruths", "NormalTruth", "MixingDensity", "Windows", "JumpChain", "Estimate", "Combination"),
        *("Batch", "Left", "_Equations", "OtherStatement", "_Release"),
        "Whitening",
        *("Confined", "ConfinedLaw"),
        *("Autoregressions", "ExpectedInputs", "UnknownDirections", "KnotPlaces", "_Exact"),
        *("Setting", "Drive", "Hypothesis", "Expected", "Choice", "Experimenter"),
        *("Piece", "Law", "Linearised", "Interval", "Segment", "Suffixes", "Search", "Scores", "_Beside"),
        *("CovariateSums", "Profile", "Points", "_Points", "Spline", "FittedForm", "FoundCurve", "EmpiricalFit"),
    }


@pytest.mark.parametrize("room", ROOMS)
def test_a_class_that_only_lists_fields_is_a_dataclass(room: str) -> None:
    """Without the decorator it could not be constructed."""
    found = {
        f"{path.relative_to(ROOT)}:{node.name}"
        for path in (ROOT / room).rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef) and is_plain(node)
    }
    assert found == set()
