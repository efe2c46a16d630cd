"""Run one case: simulated drive, comparison, corrected configuration, second drive.

    drive ▸ recording ▸ `regolithd mismatch --corrected` ▸ `regolithd calibrate corrected` ▸ second drive ▸ estimates

The comparison runs in a separate process, in a folder that holds only the recording and SIM.toml. Where the kernel has
user namespaces it cannot see this process, which alone has the ground truth.
"""

from __future__ import annotations

import json
import shutil
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from regolithd.calibration.drivetrain.bench.from_corrected_simulation import copy_drivetrain
from regolithd.calibration.validation.blind_trials.isolation import run_isolated
from regolithd.daemon.closed_loop.case import first_scenario, rover_toml, second_scenario, sim_toml
from regolithd.daemon.closed_loop.simulated_drive import record, simulate
from regolithd.daemon.closed_loop.soil_estimates import SoilEstimates, soil_estimates
from regolithd.daemon.closed_loop.speed_profile import shuttle, traverse
from regolithd.daemon.config.reader import read_configuration

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from regolithd.daemon.closed_loop.case import Case
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.terrain_network import TerrainNetwork

COMPARISON_TIMEOUT_S = 1800.0


@dataclass(frozen=True, slots=True)
class DriveLengths:
    """Durations of both drives [s]; the second must be long enough to cross three soils of `stretch_m`."""

    first_s: float = 1200.0
    second_s: float = 720.0
    stretch_m: float = 4.5


@dataclass(frozen=True, slots=True, eq=False)
class LoopResult:
    """The outcome of one case.

    Attributes
    ----------
    answer, corrected_answer
        The comparison's answers: of the first simulation, and of the corrected one with the same recording.
    changes
        One line for each value that was changed in `rover.toml`.
    configuration
        The corrected configuration.
    before, after, with_true_drivetrain
        Soil estimates of the second drive: with the first configuration, with the corrected one, and with the true
        drivetrain, which is the lower limit of the error.
    """

    case: Case
    answer: Mapping[str, Any]
    corrected_answer: Mapping[str, Any]
    changes: tuple[str, ...]
    configuration: Configuration
    before: SoilEstimates
    after: SoilEstimates
    with_true_drivetrain: SoilEstimates

    @property
    def names(self) -> tuple[str, ...]:
        """The effects that the comparison named."""
        return tuple(effect["name"] for effect in self.answer["effects"])


def run_case(
    case: Case, seed: int, folder: Path, network: TerrainNetwork, lengths: DriveLengths, progress: Callable[[str], None]
) -> LoopResult:
    """Run one case; its files stay in `folder`. `progress` is called with a line of text for each step."""
    shutil.rmtree(folder, ignore_errors=True)
    solver = folder / "comparison"
    solver.mkdir(parents=True)
    rover = folder / "rover.toml"
    rover.write_text(rover_toml(case), encoding="utf-8")
    known = read_configuration(rover)
    first = first_scenario(case, seed)
    rate_Hz = known.sync.rate_Hz
    progress("first drive, on the known soil")
    recorded = simulate(first, known, shuttle(seed, lengths.first_s, rate_Hz))
    (solver / "SIM.toml").write_text(sim_toml(case), encoding="utf-8")
    shutil.move(record(recorded, known, network, folder / "recording"), solver / "drive.mcap")
    progress("comparison with the simulation")
    answer = _compare(solver, "SIM.toml", "answer.json", "NEW.toml")
    progress("comparison with the corrected simulation")
    corrected_answer = _compare(solver, "NEW.toml", "corrected-answer.json", "NEW2.toml")
    changes = _apply(solver / "NEW.toml", rover) if answer["effects"] else ()
    progress("second drive, on other soils")
    corrected = read_configuration(rover)
    second = simulate(second_scenario(first, lengths.stretch_m), known, traverse(seed, lengths.second_s, rate_Hz))
    true = first.drivetrain.model_copy(update={"gain_relative_std": known.drivetrain.gain_relative_std})
    return LoopResult(
        case,
        answer,
        corrected_answer,
        changes,
        corrected,
        soil_estimates(second, known, network),
        soil_estimates(second, corrected, network),
        soil_estimates(second, known.model_copy(update={"drivetrain": true}), network),
    )


def _compare(folder: Path, simulation: str, answer: str, corrected: str) -> dict[str, Any]:
    """Run `regolithd mismatch` and return its answer.

    Raises
    ------
    SolverError
        When the comparison fails.
    """
    command = [sys.executable, "-m", "regolithd", "mismatch", "drive.mcap", "--simulation", simulation]
    run_isolated(
        [*command, "--json", answer, "--corrected", corrected, "--report", f"{simulation[:-5]}.html"],
        folder,
        threads=1,
        timeout_s=COMPARISON_TIMEOUT_S,
    )
    found: dict[str, Any] = json.loads((folder / answer).read_text(encoding="utf-8"))
    return found


def _apply(corrected: Path, rover: Path) -> tuple[str, ...]:
    """Write the corrected drivetrain into `rover.toml`, as `regolithd calibrate corrected` does; return the changes."""
    shutil.copy(rover, rover.with_name("rover-before.toml"))
    update = copy_drivetrain(corrected, rover)
    rover.write_text(update.text, encoding="utf-8")
    return tuple(update.messages)
