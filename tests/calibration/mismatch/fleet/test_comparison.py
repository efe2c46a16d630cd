"""Recordings of several rovers are compared together: what is found says on which rovers and since when."""

from __future__ import annotations

import os
import signal
import tomllib
import weakref
from datetime import timedelta
from typing import TYPE_CHECKING, Any, TypeVar

import fleet_arm
import numpy as np
import pyarrow.parquet
import pytest
from jsonschema import Draft202012Validator

from regolithd.calibration.mismatch import MismatchError, compare, load_simulation
from regolithd.calibration.mismatch.fleet.comparison import FleetComparison, Member, compare_fleet
from regolithd.calibration.mismatch.fleet.told.answer import fleet_answer_schema
from regolithd.calibration.mismatch.fleet.work.found import Found
from regolithd.calibration.mismatch.fleet.work.store import Store
from regolithd.calibration.mismatch.fleet.work.workers import DaskCluster, ThisProcess
from regolithd.calibration.mismatch.thresholds import THRESHOLDS
from regolithd.calibration.validation.fleet_study.__main__ import largest_difference

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

    from regolithd.calibration.mismatch.fleet.told.answer import FleetEffect

Result = TypeVar("Result")

DRIVES = 5
NOTHING: list[Mapping[str, Any]] = [{}] * DRIVES
CHANGED: list[Mapping[str, Any]] = [{}] * 3 + [{"viscous": 0.08}] * 2
WEARING: list[Mapping[str, Any]] = [{}, {}, *({"coulomb": (0.0, 0.05 * n)} for n in range(1, 4))]


def compared(folder: Path, rovers: Mapping[str, Sequence[Mapping[str, Any]]]) -> FleetComparison:
    """Write the recordings and compare them in this process."""
    return compare_fleet(fleet_arm.season(folder, rovers), fleet_arm.loader(folder))


def effect_of(found: FleetComparison, rover: str) -> FleetEffect:
    """Return the one effect of a rover."""
    (effect,) = [effect for effect in found.answer.effects if effect.rovers == (rover,)]
    return effect


def day(number: int, place: int) -> str:
    """Return when a rover's recording began, as the answer tells it."""
    begins = fleet_arm.FIRST + timedelta(days=fleet_arm.DAYS_APART * number, hours=place)
    return begins.isoformat().replace("+00:00", "Z")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return where the recordings of the fleet are."""
    return tmp_path_factory.mktemp("fleet")


@pytest.fixture(scope="module")
def members(folder: Path) -> list[Member]:
    """Return a fleet in which one rover changes half way, one bearing wears, and one has nothing."""
    return fleet_arm.season(folder, {"changed": CHANGED, "sound": NOTHING, "wearing": WEARING})


@pytest.fixture(scope="module")
def fleet(members: list[Member], folder: Path) -> FleetComparison:
    """Return its comparison in this process; results are kept beside it."""
    return compare_fleet(members, fleet_arm.loader(folder), store=Store(folder / "parts"))


def test_a_change_half_way_has_its_rover_and_date(fleet: FleetComparison) -> None:
    """On all wheels of that rover, since the first recording that has it."""
    effect = effect_of(fleet, "changed")
    assert (effect.name, effect.wheels) == ("viscous-friction", fleet_arm.JOINTS)
    assert effect.since_low is not None
    assert effect.since_high is not None
    assert effect.since_low <= day(3, 0) <= effect.since_high
    size = next(iter(effect.parameters.values()))
    assert size.low < 0.08 < size.high


def test_a_wearing_bearing_has_its_wheel_and_grows(fleet: FleetComparison) -> None:
    """Drag that was not there before, on one joint, in the recordings since then alone."""
    effect = effect_of(fleet, "wearing")
    assert (effect.name, effect.wheels) == ("bearing-drag", ("wrist",))
    assert effect.since_low is not None
    assert effect.since_high is not None
    assert effect.since_low <= day(2, 2) <= effect.since_high
    assert len(effect.recordings) < DRIVES
    assert "growing" in effect.statement
    assert effect.rmse_after < effect.rmse_before


@pytest.mark.timeout(300)
@pytest.mark.filterwarnings("ignore")  # a killed worker is no news
def test_a_cluster_that_loses_a_worker_has_the_same_answer(
    fleet: FleetComparison, members: list[Member], folder: Path
) -> None:
    """To one part in 10⁹, wherever the recordings were compared."""
    distributed = pytest.importorskip("distributed", reason="pip install 'regolithd[cluster]'")
    killed: list[int] = []
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:

        def kill(step: str, done: int, of: int) -> None:
            if step == "comparing" and not killed and of // 2 <= done < of:
                killed.append(next(iter(cluster.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        with DaskCluster(cluster.scheduler_address) as workers:
            again = compare_fleet(members, fleet_arm.loader(folder), workers=workers, progress=kill)
    assert len(killed) == 1
    assert workers._client.status == "closed"
    assert largest_difference(fleet.to_json(), again.to_json()) < 1e-9


def test_a_comparison_continues_with_what_is_stored(
    fleet: FleetComparison, members: list[Member], folder: Path
) -> None:
    """Only what is missing or damaged is computed again: the answer is the same."""
    parts = sorted((folder / "parts").iterdir())
    parts[0].unlink()
    parts[1].write_bytes(parts[1].read_bytes()[:1000])
    steps: list[tuple[str, int, int]] = []
    again = compare_fleet(
        members,
        fleet_arm.loader(folder),
        store=Store(folder / "parts"),
        progress=lambda *step: steps.append(step),
    )
    assert largest_difference(fleet.to_json(), again.to_json()) < 1e-9
    # Each step is told once at its begin, and once for each recording that is computed; shapes are summed twice.
    assert sum(1 for step, _, _ in steps if step in {"comparing", "summing"}) == 3 + 2


class Watched(ThisProcess):
    """Tasks one after the other; it counts the recordings of which columns are in memory when another is compared."""

    def __init__(self) -> None:
        self.alive: list[int] = []
        self._columns: list[list[weakref.ref[Any]]] = []

    def results(
        self, numbers: Sequence[int], task_of: Callable[[int], Callable[[], Result]]
    ) -> Iterator[tuple[int, Result]]:
        """Yield in the order of the numbers."""
        for number in numbers:
            self.alive.append(sum(any(each() is not None for each in some) for some in self._columns))
            result = task_of(number)()
            if isinstance(result, Found):
                self._columns.append([weakref.ref(term.columns) for term in result.terms])
            yield number, result


def test_memory_holds_the_columns_of_one_recording_at_a_time(tmp_path: Path) -> None:
    """However many there are: each shows an effect, whose columns are as long as it."""
    drives: list[Mapping[str, Any]] = [{"coulomb": (0.2, 0.2)}] * 4
    watched = Watched()
    compare_fleet(fleet_arm.season(tmp_path, {"a": drives}), fleet_arm.loader(tmp_path), workers=watched)
    assert len(watched.alive) == 2 * len(drives)
    assert max(watched.alive) == 1
    assert watched.alive[len(drives) + 1 :] == [0] * (len(drives) - 1)


def test_nothing_is_said_of_a_sound_rover(fleet: FleetComparison) -> None:
    """Only two effects are named, and the sound rover is in none."""
    assert fleet.answer.verdict == "missing-physics"
    assert len(fleet.answer.effects) == 2
    assert fleet.answer.fit.held_out_rmse_after < fleet.answer.fit.held_out_rmse_before


def test_the_answer_follows_its_schema(fleet: FleetComparison) -> None:
    """It is the contract's, with rovers, recordings and dates."""
    errors = Draft202012Validator(fleet_answer_schema()).iter_errors(fleet.to_json())
    assert [error.message for error in errors] == []
    assert [rover["name"] for rover in fleet.to_json()["rovers"]] == ["changed", "sound", "wearing"]


def test_the_catalogue_answers_since_when_and_where(fleet: FleetComparison, tmp_path: Path) -> None:
    """One query: the first recording in which each effect acts, by rover and wheel."""
    path = tmp_path / "season.parquet"
    fleet.write_catalogue(path)
    table = pyarrow.parquet.read_table(path, filters=[("acts", "=", True)])
    since = table.group_by(["rover", "wheel", "effect"]).aggregate([("begins", "min")]).to_pylist()
    found = {(row["rover"], row["wheel"], row["effect"]) for row in since}
    assert found == {
        ("changed", "elbow", "viscous-friction"),
        ("changed", "wrist", "viscous-friction"),
        ("wearing", "wrist", "bearing-drag"),
    }
    silent = pyarrow.parquet.read_table(path, filters=[("rover", "=", "sound")]).to_pylist()
    assert len(silent) == DRIVES
    assert {row["effect"] for row in silent} == {""}


def test_the_size_in_each_recording_follows_the_wear(fleet: FleetComparison) -> None:
    """The catalogue has the size in every recording alone, before the onset too."""
    sizes = [row.value for row in fleet.evidence.rows if row.effect == "bearing-drag"]
    assert len(sizes) == DRIVES
    assert sizes[-1] == pytest.approx(0.15, abs=0.04)
    assert abs(sizes[0] or 1) < 0.04


def test_an_effect_of_all_rovers_is_one_effect(tmp_path: Path) -> None:
    """All rovers share it, although no single recording would need to show it."""
    drives: list[Mapping[str, Any]] = [{"coulomb": (0.05, 0.05)}] * 2
    answer = compared(tmp_path, {"a": drives, "b": drives}).answer
    (effect,) = answer.effects
    assert (effect.name, effect.rovers, effect.since) == ("coulomb-friction", ("a", "b"), None)
    assert answer.probability is not None
    assert 0.5 < answer.probability <= THRESHOLDS.highest_season_probability
    assert effect.parameters["coulomb_current"].low < 0.05 < effect.parameters["coulomb_current"].high


def test_a_ripple_that_no_recording_shows_is_found_in_all_together() -> None:
    """It has a sine of each wheel, at one phase in all of its recordings."""
    recordings = [fleet_arm.columns(n, ripple=0.02) for n in range(6)]
    assert compare(recordings[0], fleet_arm.ArmWithAngle()).answer.verdict == "consistent"
    found = compare(recordings, fleet_arm.ArmWithAngle())
    (effect,) = found.answer.effects
    assert (effect.name, effect.wheels) == ("wheel-angle-ripple", fleet_arm.JOINTS)
    assert effect.parameters["order"].value == fleet_arm.RIPPLES
    assert effect.parameters["amplitude"].low < 0.02 < effect.parameters["amplitude"].high
    alone = [row.value for row in found.evidence.rows]
    assert alone == pytest.approx([0.02] * 12, abs=0.03)


def test_a_ripple_of_one_joint_is_told_on_it_alone() -> None:
    """Both would gain a little more by chance: each wheel has two coefficients of its own in each rover."""
    recordings = [fleet_arm.columns(n) for n in range(6)]
    for n, rippled in enumerate(fleet_arm.columns(n, ripple=0.05) for n in range(6)):
        first = rippled["axis"] == fleet_arm.JOINTS[0]
        recordings[n] = {name: np.where(first, values, recordings[n][name]) for name, values in rippled.items()}
    (effect,) = compare(recordings, fleet_arm.ArmWithAngle()).answer.effects
    assert (effect.name, effect.wheels) == ("wheel-angle-ripple", fleet_arm.JOINTS[:1])
    assert effect.parameters["amplitude"].low < 0.05 < effect.parameters["amplitude"].high


def test_a_ripple_that_recordings_show_is_the_fleet_s() -> None:
    """Although its order was found to be another in each, to within the width of a line."""
    found = compare([fleet_arm.columns(n, ripple=0.1) for n in range(3)], fleet_arm.ArmWithAngle())
    (effect,) = found.answer.effects
    assert effect.parameters["order"].value == fleet_arm.RIPPLES


def test_a_ripple_is_carried_to_a_later_recording(tmp_path: Path) -> None:
    """Each wheel's with the coefficients of its own."""
    simulation, new = load_simulation(fleet_arm.write_simulation(tmp_path, "ArmWithAngle")), tmp_path / "NEW.toml"
    compare([fleet_arm.columns(n, ripple=0.1) for n in range(4)], simulation).write_corrected(new)
    (effect,) = tomllib.loads(new.read_text())["effects"]
    assert np.hypot(*np.reshape(effect["coefficients"][:4], (2, 2)).T) == pytest.approx([0.1, 0.1], rel=0.2)
    assert compare(fleet_arm.columns(9, ripple=0.1), load_simulation(new)).answer.verdict == "consistent"


def test_what_is_looked_for_in_each_recording_alone_is_told_so() -> None:
    """Where no angle is recorded, a ripple's phase is another in each."""
    found = compare([fleet_arm.columns(n) for n in range(2)], ArmOfUnknownAngle())
    assert "Looked for in each recording by itself, not in all together: wheel-angle-ripple." in found.answer.notes
    (least,) = [one.smallest_detectable for one in found.answer.sensitivity if one.name == "wheel-angle-ripple"]
    assert least == float("inf")


class ArmOfUnknownAngle(fleet_arm.ArmWithAngle):
    """The same without the angle."""

    def covariates(self, inputs: Mapping[str, Any]) -> dict[str, Any]:
        """Return what friction follows but the angle."""
        return {name: values for name, values in super().covariates(inputs).items() if name != "wheel_angle"}


def test_a_fleet_without_a_finding_is_consistent(tmp_path: Path) -> None:
    """And tells how small an effect it would have shown: smaller than one recording does."""
    found = compared(tmp_path, {"a": NOTHING[:2], "b": NOTHING[:2]}).answer
    assert (found.verdict, found.effects, found.unexplained) == ("consistent", (), ())
    alone = compare(fleet_arm.season(tmp_path, {"a": [{}]})[0].read(), fleet_arm.Arm()).answer
    of = {one.name: one.smallest_detectable for one in alone.sensitivity}
    least = {one.name: one.smallest_detectable for one in found.sensitivity}
    assert least["coulomb-friction"] < 0.7 * of["coulomb-friction"]


def test_what_one_recording_shows_is_reported_with_it(tmp_path: Path) -> None:
    """An effect in a single recording of many is none of the rover."""
    drives: list[Mapping[str, Any]] = [{}, {"coulomb": (0.3, 0.3)}, {}, {}]
    (effect,) = compared(tmp_path, {"a": drives}).answer.effects
    assert effect.name == "coulomb-friction"
    assert len(effect.recordings) == 1
    assert effect.rovers == ("a",)


def test_a_curve_without_a_name_has_its_rovers_and_its_date(tmp_path: Path) -> None:
    """One that single recordings do not show, and that no law of the library is."""
    hump: list[Mapping[str, Any]] = [{}, {}, {"hump": 0.06}, {"hump": 0.06}, {"hump": 0.06}]
    answer = compared(tmp_path, {"a": hump, "b": NOTHING, "c": hump}).answer
    (rest,) = answer.unexplained
    assert (answer.verdict, answer.effects) == ("unexplained", ())
    assert (rest.covariate, rest.rovers, len(rest.recordings)) == ("wheel_speed", ("a", "c"), 6)
    assert (rest.since, rest.until) == (day(2, 0), None)
    assert rest.told_where == "6 recordings of a and c since 2026-03-15 08:00"
    assert answer.fit.held_out_rmse_after < answer.fit.held_out_rmse_before
    assert answer.probability is not None


def test_what_the_last_recording_shows_by_itself_is_carried_over(tmp_path: Path) -> None:
    """The corrected simulation of a rover is as it is in its last recording."""
    drives: list[Mapping[str, Any]] = [{}, {}, {}, {"coulomb": (0.3, 0.0)}]
    found = compared(tmp_path, {"a": drives})
    (effect,) = found.answer.effects
    found.write_corrected(tmp_path / "NEW.toml")
    (carried,) = tomllib.loads((tmp_path / "NEW.toml").read_text(encoding="utf-8"))["effects"]
    assert (carried["name"], carried["wheels"]) == (effect.name, ["elbow"])
    assert carried["coefficients"][0] == pytest.approx(0.3, rel=0.2)


def test_a_list_of_tables_is_compared_together() -> None:
    """In Python: `compare([one, two, …], simulation)`, without a word on rovers and dates."""
    found = compare([fleet_arm.columns(n, (0.2, 0.2)) for n in range(2)], fleet_arm.Arm())
    (effect,) = found.answer.effects
    assert (effect.name, effect.rovers) == ("coulomb-friction", ("rover",))
    assert effect.recordings == ("recording 1", "recording 2")


def test_a_recording_that_cannot_be_compared_is_left_out(tmp_path: Path) -> None:
    """With its reason, while the others are compared; without any other, it is an error."""
    members = fleet_arm.season(tmp_path, {"a": NOTHING[:1]})
    unmeasured = members[0].read().channel("none")
    broken = Member("broken.csv", "a", None, lambda: members[0].read().with_channels(torque_Nm=unmeasured))
    found = compare_fleet([*members, broken], fleet_arm.Arm)
    assert any(note.startswith("broken.csv is left out") for note in found.answer.notes)
    with pytest.raises(MismatchError, match=r"broken\.csv is left out"):
        compare_fleet([broken], fleet_arm.Arm)
