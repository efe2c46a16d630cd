"""Comparing the recordings of a fleet together: `compare_fleet`, and `compare`, which takes one recording or many."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from functools import partial
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, overload

from regolithd.calibration.mismatch import comparison as single
from regolithd.calibration.mismatch.data.recording import as_recording
from regolithd.calibration.mismatch.errors import MismatchError, RecordingError
from regolithd.calibration.mismatch.fleet.catalogue import catalogue_rows, write_catalogue
from regolithd.calibration.mismatch.fleet.choice.chance import entry_threshold
from regolithd.calibration.mismatch.fleet.choice.common_noise import with_common_noise
from regolithd.calibration.mismatch.fleet.choice.curves import with_curves
from regolithd.calibration.mismatch.fleet.choice.earned import earned
from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations, Level, fleet_equations
from regolithd.calibration.mismatch.fleet.choice.released import with_released
from regolithd.calibration.mismatch.fleet.choice.search import places_of
from regolithd.calibration.mismatch.fleet.choice.selection import Chooser
from regolithd.calibration.mismatch.fleet.corrected import acting_last, write_corrected
from regolithd.calibration.mismatch.fleet.evidence import FleetEvidence
from regolithd.calibration.mismatch.fleet.member import ONLY_ROVER
from regolithd.calibration.mismatch.fleet.told.chosen import Chosen, Names
from regolithd.calibration.mismatch.fleet.told.findings import answer_of_fleet
from regolithd.calibration.mismatch.fleet.told.joint import joint_parameters
from regolithd.calibration.mismatch.fleet.work.curves import with_curves_of
from regolithd.calibration.mismatch.fleet.work.found import Found, found_in, one_channel
from regolithd.calibration.mismatch.fleet.work.grid import GridGroup, finer_grid, grid_of, placed
from regolithd.calibration.mismatch.fleet.work.kept_columns import KeptColumns
from regolithd.calibration.mismatch.fleet.work.sums import Laws, Sums, forms_of, sums_of
from regolithd.calibration.mismatch.fleet.work.workers import ThisProcess, Workers
from regolithd.calibration.mismatch.inference.several_channels import joined, of_single_wheels
from regolithd.calibration.mismatch.inference.statements import noun_of
from regolithd.calibration.mismatch.report.labels import Labels

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from datetime import datetime
    from pathlib import Path

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit
    from regolithd.calibration.mismatch.fleet.told.answer import FleetAnswer
    from regolithd.calibration.mismatch.fleet.work.store import Store
    from regolithd.calibration.mismatch.result import Comparison
    from regolithd.calibration.mismatch.simulation.simulation import Simulation

Result = TypeVar("Result")
Progress = "Callable[[str, int, int], None]"


@dataclass(frozen=True)
class Member:
    """A recording of a fleet, and how to read it; it is read where it is compared.

    Attributes
    ----------
    name: unique in the fleet
    rover: who drove it
    begins: when it began; None: not known
    read: returns it; has to be picklable where it is compared by other processes
    digest: of its content; empty: what is found in it is not stored
    """

    name: str
    rover: str
    begins: datetime | None
    read: Callable[[], Recording]
    digest: str = ""


@dataclass(frozen=True)
class FleetComparison:
    """The answer of a fleet, and what was found in which recording; a notebook shows it as the report."""

    answer: FleetAnswer
    evidence: FleetEvidence = field(repr=False)
    simulation: Simulation = field(repr=False)

    def to_json(self) -> dict[str, Any]:
        """Return what `regolithd mismatch --json` writes."""
        return self.answer.to_json()

    def write_catalogue(self, path: Path) -> None:
        """Write what was found in which recording as a Parquet file."""
        write_catalogue(path, self.evidence.rows)

    def write_corrected(self, path: Path) -> None:
        """Write the corrected SIM.toml of one rover, as it is in its last recording.

        Raises
        ------
        MismatchError
            When there are several rovers, or the simulation does not come from a SIM.toml.
        """
        write_corrected(path, self.answer, self.evidence.acting, self.simulation)

    def _repr_html_(self) -> str:
        # A notebook alone shows the report; the command line starts sooner without it.
        from regolithd.calibration.mismatch.fleet.report.page import fleet_report  # noqa: PLC0415
        from regolithd.calibration.mismatch.report.notebook import in_frame  # noqa: PLC0415

        return in_frame(fleet_report(self.answer, self.evidence))


@overload
def compare(  # type: ignore[overload-overlap]  # a list is an object too
    recording: list[Any] | tuple[Any, ...], simulation: Simulation
) -> FleetComparison: ...
@overload
def compare(
    recording: object,
    simulation: Simulation,
    **options: Any,  # noqa: ANN401
) -> Comparison: ...
def compare(
    recording: Recording | object,
    simulation: Simulation,
    **options: Any,  # of `comparison.compare`
) -> Comparison | FleetComparison:
    """Compare a recording with a simulation, or a list of recordings together.

    Parameters
    ----------
    recording: as `read_recording` returns it, a data frame or a mapping of arrays; or a list of these, or of `Member`s,
        which say which rover each is of and when it began
    options: of `regolithd.calibration.mismatch.comparison.compare`, for one recording

    Raises
    ------
    MismatchError
        When there is nothing to compare.
    """
    if not isinstance(recording, list | tuple):
        return single.compare(recording, simulation, **options)
    members = [_member(number, each, simulation) for number, each in enumerate(recording, 1)]
    return compare_fleet(members, lambda: simulation)


def _member(number: int, data: object, simulation: Simulation) -> Member:
    if isinstance(data, Member):
        return data
    recorded = as_recording(data, unit=simulation.wheel_column)
    return Member(f"recording {number}", ONLY_ROVER, None, lambda: recorded)


def compare_fleet(
    members: Sequence[Member],
    load: Callable[[], Simulation],
    *,
    level: Level = "rover",
    workers: Workers | None = None,
    store: Store | None = None,
    key: str = "",
    progress: Callable[[str, int, int], None] = lambda *_: None,
) -> FleetComparison:
    """Compare recordings of one or several rovers together.

    Parameters
    ----------
    members: the recordings
    load: returns the simulation; it is called wherever recordings are compared
    level: whose the simulation's parameters are: `shared`, each `rover`'s own, or each `recording`'s
    workers: where recordings are compared; None: in this process
    store, key: where results of recordings are kept, and a digest of the simulation; None: nowhere
    progress: called with the step, how many recordings are done, and of how many

    Raises
    ------
    MismatchError
        When no recording can be compared.
    """
    simulation = load()
    work = _Work(workers or ThisProcess(), store, key, progress)
    names = [member.name for member in members]
    if len(set(names)) < len(names):
        raise RecordingError("two recordings of a fleet have the same name")
    channels = list(simulation.channels) or [simulation.channel]
    compared = [
        _of_channel(members, load, one_channel(simulation, channel), channel, level, work) for channel in channels
    ]
    work.tidy()
    answers = [answer_of_fleet(chosen, len(compared)) for chosen in compared]
    rows = tuple(
        row for chosen, answer in zip(compared, answers, strict=True) for row in catalogue_rows(chosen, answer)
    )
    answer = answers[0]
    if len(answers) > 1:
        told = (parameter for each in answers for parameter in each.parameters)
        together = (*joint_parameters(compared), *of_single_wheels(told, simulation.parameters))
        answer = replace(joined(answers), parameters=together)
    units = {channel: chosen.simulation.unit for channel, chosen in zip(channels, compared, strict=True)}
    wheels = tuple(dict.fromkeys(wheel for chosen in compared for wheel in chosen.equations.wheels))
    acting = tuple(
        told
        for channel, chosen, one in zip(channels, compared, answers, strict=True)
        for told in acting_last(chosen, one, channel if len(channels) > 1 else "")
    )
    evidence = FleetEvidence(rows, _labels_of(simulation, compared), units, wheels, acting)
    return FleetComparison(replace(answer, notes=(*answer.notes, *dict.fromkeys(work.notes))), evidence, simulation)


def _labels_of(simulation: Simulation, compared: Sequence[Chosen]) -> Labels:
    """Return what a fleet's report calls axes, covariates and effects."""
    corrected = frozenset(effect.name for effect in (*simulation.corrected_effects, *simulation.stated_effects()))
    covariates = {name: label for chosen in compared for name, label in chosen.labels.items()}
    return Labels(noun_of(simulation.wheel_column), covariates, time_unit="s", corrected=corrected)


@dataclass
class _Work:
    """Does a step for all recordings, with what is stored already."""

    workers: Workers
    store: Store | None
    key: str
    progress: Callable[[str, int, int], None]
    notes: list[str] = field(default_factory=list)
    keys: list[str] = field(default_factory=list)

    def done(
        self,
        step: str,
        members: Sequence[Member],
        task_of: Callable[[int], Callable[[], Result]],
        depends: str,
        kept: Callable[[int, Result], Result] = lambda _, result: result,
    ) -> dict[int, Result]:
        """Return what the step gives for each recording that it can be done for, by its number.

        Of each result, as it comes, `kept` returns what is held in memory.
        """
        found: dict[int, Result] = {}
        keys = [self._key(step, member, depends) for member in members]
        self.keys += keys
        if self.store is not None:
            for number, key in enumerate(keys):
                if members[number].digest and (value := self.store.read(key)) is not None:
                    found[number] = kept(number, value)
        self.progress(step, len(found), len(members))
        left = [number for number in range(len(members)) if number not in found]
        for number, result in self.workers.results(left, lambda number: partial(_tried, task_of(number))):
            if isinstance(result, str):
                self.notes.append(f"{members[number].name} is left out: {result}")
                continue
            if self.store is not None and members[number].digest:
                self.store.write(keys[number], result)
            found[number] = kept(number, result)
            self.progress(step, len(found), len(members))
        if not found:
            raise MismatchError("; ".join(self.notes) or "there is no recording")
        return found

    def _key(self, step: str, member: Member, depends: str) -> str:
        try:
            package = version("regolithd")
        except PackageNotFoundError:
            package = ""
        told = repr((step, member.digest, self.key, package, depends))
        return sha256(told.encode()).hexdigest()[:32]

    def tidy(self) -> None:
        """Remove stored results that this comparison did not use."""
        if self.store is not None:
            self.store.keep_only(self.keys)


def _tried(task: Callable[[], Result]) -> Result | str:
    """Return a task's result, or why the recording cannot be used."""
    try:
        return task()
    except MismatchError as error:
        return str(error)


def _find(read: Callable[[], Recording], load: Callable[[], Simulation], channel: str) -> Found:
    return found_in(read(), load(), channel)


def _sum(read: Callable[[], Recording], load: Callable[[], Simulation], channel: str, laws: Laws, found: Found) -> Sums:
    return sums_of(read(), load(), channel, laws, found)


def _of_channel(
    members: Sequence[Member],
    load: Callable[[], Simulation],
    simulation: Simulation,
    channel: str,
    level: Level,
    work: _Work,
) -> Chosen:
    """Compare each recording, sum their products in a common grid, and choose the effects of the fleet."""
    columns = KeptColumns()
    found = work.done(
        "comparing",
        members,
        lambda n: partial(_find, members[n].read, load, channel),
        channel,
        lambda n, result: columns.without(members[n].name, result),
    )
    kept = sorted(found)
    compared = _Compared([members[n] for n in kept], [found[n] for n in kept], columns)
    grid = grid_of(forms_of(simulation), compared.found, 0, [member.rover for member in compared.members])
    grid = with_curves_of(grid, compared.found)
    searched = compared.searched(grid, load, channel, level, work)
    finer = finer_grid(grid, [term.group for term in searched.fit.terms], compared.found)
    if len(finer) > len(grid):
        del searched  # memory holds the sums of one search at a time
        searched = compared.searched(finer, load, channel, level, work)
    chooser, results = searched.chooser, searched.found
    fit = earned(chooser, with_curves(chooser, searched.fit, results, simulation.parameters), results)
    chooser = replace(chooser, equations=with_released(chooser.equations, fit, results, simulation.parameters))
    fit = earned(chooser, chooser.equations.fit(fit.terms), results)  # a released parameter may act as a name does
    return Chosen(chooser, fit, searched.names, results, simulation)


class _Searched(NamedTuple):
    """A choice from the sums of the recordings that could be summed."""

    chooser: Chooser
    fit: FleetFit
    names: Names
    found: tuple[Found, ...]


@dataclass(frozen=True, eq=False)
class _Compared:
    """Recordings that were compared each by itself, what was found in them, and the columns of that."""

    members: Sequence[Member]
    found: Sequence[Found]
    columns: KeptColumns

    def searched(
        self, grid: Sequence[GridGroup], load: Callable[[], Simulation], channel: str, level: Level, work: _Work
    ) -> _Searched:
        """Sum the products of the recordings' columns in a common grid, and choose the effects of the fleet."""
        laws: Laws = tuple((group.candidate.name, group.shape) for group in grid)
        members, found, restored = self.members, self.found, self.columns.restored
        sums = work.done(
            "summing",
            members,
            lambda n: partial(_sum, members[n].read, load, channel, laws, restored(members[n].name, found[n])),
            json.dumps((channel, laws), sort_keys=True),
        )
        kept = sorted(sums)
        names = _names([members[n] for n in kept])
        weighted = with_common_noise([sums[n] for n in kept], [found[n] for n in kept])
        equations = _equations(weighted, names, [members[n] for n in kept], grid, level)
        work.progress("searching", len(kept), len(kept))
        places = places_of(equations)
        chooser = Chooser(equations, places, entry_threshold(equations, places))
        return _Searched(chooser, chooser.chosen(), names, tuple(found[n] for n in kept))


def _names(members: Sequence[Member]) -> Names:
    rovers = tuple(sorted({member.rover for member in members}))
    return Names(rovers, tuple(member.name for member in members), tuple(member.begins for member in members))


def _equations(
    sums: Sequence[Sums], names: Names, members: Sequence[Member], grid: Sequence[GridGroup], level: Level
) -> FleetEquations:
    dates = [begins for begins in names.begins if begins is not None]
    when = [each.timestamp() for each in dates] if len(dates) == len(names.begins) else list(range(len(members)))
    rover = [names.rovers.index(member.rover) for member in members]
    first = len({name for each in sums for name in each.tangents})
    return fleet_equations(sums, rover, when, placed(grid, sums, first), level)
