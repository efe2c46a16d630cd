"""`regolithd mismatch` with the recordings of several rovers: whose each is, and the comparison from files to files."""

from __future__ import annotations

import json
import sys
from contextlib import ExitStack
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from regolithd.calibration.mismatch.data.columns import rovers_in
from regolithd.calibration.mismatch.data.stretches import LONGEST_AT_ONCE, Stretch, rows_in, stretches_of
from regolithd.calibration.mismatch.errors import MismatchError, RecordingError
from regolithd.calibration.mismatch.fleet.comparison import Member, compare_fleet
from regolithd.calibration.mismatch.fleet.member import ONLY_ROVER, date_in
from regolithd.calibration.mismatch.fleet.work.store import Store
from regolithd.calibration.mismatch.fleet.work.workers import AllCores, DaskCluster, Workers
from regolithd.calibration.mismatch.simulation.load import load_simulation, model_folder, read_tables
from regolithd.daemon.mismatch.files import digest_of, short_names, write_fleet_page, write_json
from regolithd.daemon.mismatch.recordings import read_one
from regolithd.daemon.mismatch.terminal import print_answer
from regolithd.daemon.recording.export import recorded_snapshots
from regolithd.daemon.recording.mcap_file import DamagedRecordingError, read_metadata
from regolithd.daemon.terminal import terminal

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.answer import Answer
    from regolithd.calibration.mismatch.fleet.choice.equations import Level
    from regolithd.calibration.mismatch.fleet.told.answer import FleetAnswer
    from regolithd.daemon.mismatch.files import Outputs

RoverFrom = Literal["column", "metadata", "folder"]


@dataclass(frozen=True, slots=True)
class FleetOptions:
    """How recordings of several rovers are compared.

    Attributes
    ----------
    rover_from: what says whose a recording is; None: the column `rover` or the metadata, where there are such
    parameters: whose the simulation's parameters are
    catalogue: Parquet file of what was found in which recording; results are kept beside it
    scheduler: address of a Dask scheduler; None: all cores of this computer
    """

    rover_from: RoverFrom | None = None
    parameters: Level | None = None
    catalogue: Path | None = None
    scheduler: str | None = None

    @property
    def asked_for(self) -> bool:
        """Whether an option was given that only a fleet has."""
        return any((self.rover_from, self.parameters, self.catalogue, self.scheduler))


@dataclass(frozen=True, slots=True)
class RoverFile:
    """A file, or the rows of one rover in it; `rover` is empty where nothing says whose it is.

    What is `damaged` cannot be read: whoever reads it is told why.
    """

    path: Path
    rover: str
    of_column: bool = False
    damaged: bool = False


def files_of_rovers(paths: Sequence[Path], rover_from: RoverFrom | None) -> list[RoverFile]:
    """Return whose each recording is.

    Raises
    ------
    RecordingError
        When a recording does not say whose it is, and was to; or when one is given twice, or is a copy of another.
    """
    _check_that_each_is_another(paths)
    found = [each for path in paths for each in _rovers_of(path, rover_from)]
    if rover_from and (silent := [str(each.path) for each in found if not each.rover and not each.damaged]):
        raise RecordingError(f"{silent[0]} does not say whose it is: it has no {rover_from} that names a rover")
    return found


def _check_that_each_is_another(paths: Sequence[Path]) -> None:
    """Raise an error where two paths lead to the same readings, which would count as two recordings."""
    places = [path.resolve() for path in paths]
    if twice := [path for k, path in enumerate(paths) if places[k] in places[:k]]:
        raise RecordingError(f"{twice[0]} is given twice: the same readings would count as two recordings")
    of_size: dict[int, list[Path]] = {}
    for path in paths:
        if path.is_file() and path.stat().st_size:
            of_size.setdefault(path.stat().st_size, []).append(path)
    for alike in of_size.values():
        known: dict[str, Path] = {}
        for path in alike if len(alike) > 1 else ():  # only what is as long may be a copy, and has to be read for it
            first = known.setdefault(digest_of(path), path)
            if first is not path:
                raise RecordingError(
                    f"{path} is a copy of {first}: the same readings would count as two recordings. Leave one out"
                )


def _rovers_of(path: Path, rover_from: RoverFrom | None) -> list[RoverFile]:
    if not path.is_file():
        raise RecordingError(f"{path} is not there" if not path.exists() else f"{path} is not a file")
    if rover_from == "folder":
        return [RoverFile(path, path.resolve().parent.name)]
    if path.suffix == ".mcap":
        return [RoverFile(path, "" if rover_from == "column" else _in_metadata(path))]
    try:
        names = () if rover_from == "metadata" else rovers_in(path)
    except RecordingError:
        return [RoverFile(path, "", damaged=True)]
    return [RoverFile(path, name, of_column=True) for name in names] or [RoverFile(path, "")]


def _in_metadata(path: Path) -> str:
    """Return the name in the configuration that a recording of the daemon holds; empty where it holds none."""
    try:
        return str(json.loads(read_metadata(path).get("configuration", "{}")).get("rover", {}).get("name", ""))
    except (DamagedRecordingError, ValueError, OSError):
        return ""


def begins_at(path: Path) -> datetime | None:
    """Return when a recording began: by its first snapshot, else by a date in its name or its folder's."""
    if path.suffix == ".mcap":
        try:
            first = next(recorded_snapshots([path]), None)
        except (DamagedRecordingError, ValueError, KeyError, OSError):
            first = None
        if first is not None:
            return datetime.fromtimestamp(first.time_ns / 1e9, UTC)
    return date_in(path.name) or date_in(path.resolve().parent.name)


def members_of(files: Sequence[RoverFile], unit: str) -> list[Member]:
    """Return the recordings of a fleet; their names are the files', with folders where two have the same."""
    paths = [file.path for file in files]
    names = short_names(paths)
    found: list[Member] = []
    for file in files:
        path, name = file.path.resolve(), names[file.path]
        digest = digest_of(path) + file.rover
        whole = Member(
            name=f"{name} ({file.rover})" if paths.count(file.path) > 1 else name,
            rover=file.rover or ONLY_ROVER,
            begins=begins_at(path),
            read=partial(read_one, path, unit, file.rover if file.of_column else None),
            digest=sha256(digest.encode()).hexdigest(),
        )
        stretches = () if file.of_column or _rows_of(path) <= LONGEST_AT_ONCE else _stretches_of(path)
        found += [_of_stretch(whole, path, unit, each) for each in stretches] or [whole]
    return found


def _rows_of(path: Path) -> int:
    """Return the number of rows of a Parquet file; 0 of any other, or a damaged one: whoever reads it is told why."""
    try:
        return rows_in(path)
    except RecordingError:
        return 0


def _stretches_of(path: Path) -> tuple[Stretch, ...]:
    """Return the stretches of a Parquet file; none of any other, or a damaged one."""
    try:
        return stretches_of(path) if path.suffix == ".parquet" else ()
    except RecordingError:
        return ()


def _of_stretch(whole: Member, path: Path, unit: str, stretch: Stretch) -> Member:
    """Return a stretch of a long recording as one of its own."""
    rows = stretch.first, stretch.last
    return replace(
        whole,
        name=f"{whole.name}, {stretch.words}",
        begins=whole.begins and whole.begins + timedelta(seconds=stretch.from_s),
        read=partial(read_one, path, unit, rows=rows),
        digest=sha256(f"{whole.digest} {rows}".encode()).hexdigest(),
    )


def too_long_at_once(files: Sequence[RoverFile]) -> bool:
    """Return whether the recordings are so long that they are compared stretch by stretch."""
    paths = [file.path for file in files]
    return sum(map(_rows_of, paths)) > LONGEST_AT_ONCE and all(map(_stretches_of, paths))


def run_fleet(files: Sequence[RoverFile], simulation: Path, outputs: Outputs, options: FleetOptions) -> Answer:
    """Compare, write the outputs, print the answer and return it.

    Raises
    ------
    MismatchError
        When no recording can be compared, or the simulation cannot be used.
    """
    outputs.check()
    if outputs.corrected and len({file.rover for file in files if not file.damaged}) > 1:
        raise MismatchError("--corrected is of one rover: compare the recordings of one alone")
    if outputs.empirical:
        raise MismatchError(
            "--empirical is of recordings that are compared at once: one rover's, without --catalogue, --parameters, "
            f"--rover-from and --scheduler, and of at most {LONGEST_AT_ONCE} rows"
        )
    simulated = load_simulation(simulation, announce=partial(typer.echo, err=True))
    store = Store(_kept_beside(options.catalogue)) if options.catalogue else None
    with ExitStack() as opened:
        workers: Workers = AllCores()
        if options.scheduler:
            workers = opened.enter_context(DaskCluster(options.scheduler))
        bar = opened.enter_context(_bar())
        task = bar.add_task("reading", total=len(files))
        found = compare_fleet(
            members_of(files, simulated.wheel_column),
            partial(load_simulation, simulation.resolve()),
            level=options.parameters or "rover",
            workers=workers,
            store=store,
            key=_digest_of(simulation),
            progress=lambda step, done, of: bar.update(task, description=step, completed=done, total=of),
        )
    answer = replace(found.answer, notes=(*found.answer.notes, *_notes_of_nameless(found.answer, files)))
    if outputs.json:
        write_json(outputs.json, answer)
    if options.catalogue:
        found.write_catalogue(options.catalogue)
    if outputs.corrected:
        found.write_corrected(outputs.corrected)
    if outputs.report:
        paths = list(dict.fromkeys(file.path for file in files))
        write_fleet_page(outputs.report, replace(found, answer=answer), paths, simulation)
    print_answer(terminal(), answer, found.evidence.labels)
    return answer


def _notes_of_nameless(answer: FleetAnswer, files: Sequence[RoverFile]) -> list[str]:
    """Return a note of the recordings that do not say whose they are, where others do, and that were compared."""
    if not any(file.rover for file in files) or all(file.rover for file in files):
        return []
    return [
        f"{', '.join(rover.recordings)}: nothing says whose this is, while other recordings do. It is compared as of a "
        f"further rover, called {ONLY_ROVER}. Add a column rover, or tell rovers apart by --rover-from folder."
        for rover in answer.rovers
        if rover.name == ONLY_ROVER
    ]


def _bar() -> Progress:
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, console=terminal(stderr=True), transient=True)


def _kept_beside(catalogue: Path) -> Path:
    """Return the folder in which results of single recordings are kept."""
    if catalogue.suffix != ".parquet":
        raise MismatchError(f"{catalogue}: the catalogue is a Parquet file; name it .parquet")
    if not catalogue.resolve().parent.is_dir():
        raise MismatchError(f"{catalogue} cannot be written: there is no folder {catalogue.parent}")
    return catalogue.with_suffix(".parts")


def _digest_of(simulation: Path) -> str:
    """Return a digest of SIM.toml, and of the FMU or the module that it names."""
    tables = read_tables(simulation)
    digest = sha256(simulation.read_bytes())
    model = str(tables["simulation"]["model"])
    fmu = model_folder(tables, simulation.resolve().parent) / model
    module = sys.modules.get(model.split(":", maxsplit=1)[0])
    for path in (fmu, Path(getattr(module, "__file__", None) or "-")):
        if path.is_file():
            digest.update(path.read_bytes())
    return digest.hexdigest()
