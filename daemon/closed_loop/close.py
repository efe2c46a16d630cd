"""One run of the loop, from the first drive to the second reading.

    drive ▸ recording ▸ `regolithd mismatch --corrected` ▸ `regolithd calibrate corrected` ▸ another drive, read twice

The comparison runs in a process of its own, in a folder that holds the recording and SIM.toml and nothing else, and
where the kernel allows it cannot see this process, which alone knows the truth.
"""

from __future__ import annotations

import json
import shutil
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from regolithd.calibration.drivetrain.bench.simulation import drivetrain
from regolithd.calibration.validation.blind_trials.isolation import run_alone
from regolithd.daemon.closed_loop.case import elsewhere, rover_toml, sim_toml, world
from regolithd.daemon.closed_loop.drive import drive, record
from regolithd.daemon.closed_loop.mission import shuttle, traverse
from regolithd.daemon.closed_loop.reading import Reading, read
from regolithd.daemon.config.reader import read_configuration

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from regolithd.daemon.closed_loop.case import Case
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.terrain_network import Network

PATIENCE_S = 1800.0


@dataclass(frozen=True, slots=True)
class Lengths:
    """How long the drives are; the second must be long enough to come past three soils of `stretch_m`."""

    first_s: float = 1200.0
    second_s: float = 720.0
    stretch_m: float = 4.5


@dataclass(frozen=True, slots=True, eq=False)
class Closed:
    """What a run came to.

    `answer` is the comparison's, `again` that of the corrected simulation with the same recording. `before`, `after`
    and `told` are readings of the second drive: with the first configuration, with the corrected one, and with the
    truth of the drivetrain in it, which is the best that can be had.
    """

    case: Case
    answer: Mapping[str, Any]
    again: Mapping[str, Any]
    says: tuple[str, ...]
    configuration: Configuration
    before: Reading
    after: Reading
    told: Reading

    @property
    def names(self) -> tuple[str, ...]:
        """Return what the comparison named."""
        return tuple(effect["name"] for effect in self.answer["effects"])


def close(
    case: Case, seed: int, folder: Path, network: Network, lengths: Lengths, progress: Callable[[str], None]
) -> Closed:
    """Run one case; its files stay in the folder."""
    shutil.rmtree(folder, ignore_errors=True)
    solver = folder / "comparison"
    solver.mkdir(parents=True)
    rover = folder / "rover.toml"
    rover.write_text(rover_toml(case), encoding="utf-8")
    known = read_configuration(rover)
    first = world(case, seed)
    rate_Hz = known.sync.rate_Hz
    progress("drives to and fro on the soil that is known")
    driven = drive(first, known, shuttle(seed, lengths.first_s, rate_Hz))
    (solver / "SIM.toml").write_text(sim_toml(case), encoding="utf-8")
    shutil.move(record(driven, known, network, folder / "recording"), solver / "drive.mcap")
    progress("is compared with its simulation")
    answer = _compare(solver, "SIM.toml", "answer.json", "NEW.toml")
    progress("is compared with its corrected simulation")
    again = _compare(solver, "NEW.toml", "again.json", "AGAIN.toml")
    says = _apply(solver / "NEW.toml", rover) if answer["effects"] else ()
    progress("drives on other soils")
    corrected = read_configuration(rover)
    second = drive(elsewhere(first, lengths.stretch_m), known, traverse(seed, lengths.second_s, rate_Hz))
    true = first.drivetrain.model_copy(update={"gain_relative_std": known.drivetrain.gain_relative_std})
    return Closed(
        case,
        answer,
        again,
        says,
        corrected,
        read(second, known, network),
        read(second, corrected, network),
        read(second, known.model_copy(update={"drivetrain": true}), network),
    )


def _compare(folder: Path, simulation: str, answer: str, corrected: str) -> dict[str, Any]:
    """Run `regolithd mismatch` and return its answer.

    Raises
    ------
    SolverError
        When it fails.
    """
    command = [sys.executable, "-m", "regolithd", "mismatch", "drive.mcap", "--simulation", simulation]
    run_alone(
        [*command, "--json", answer, "--corrected", corrected, "--report", f"{simulation[:-5]}.html"],
        folder,
        threads=1,
        timeout_s=PATIENCE_S,
    )
    found: dict[str, Any] = json.loads((folder / answer).read_text(encoding="utf-8"))
    return found


def _apply(corrected: Path, rover: Path) -> tuple[str, ...]:
    """Write the corrected drivetrain into `rover.toml`, as `regolithd calibrate corrected` does; say what changed."""
    shutil.copy(rover, rover.with_name("rover-before.toml"))
    written = drivetrain(corrected, rover)
    rover.write_text(written.text, encoding="utf-8")
    return tuple(written.says)
