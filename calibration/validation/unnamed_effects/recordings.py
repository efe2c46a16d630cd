"""Recordings with one effect out of the library: of the blind trials' rover, and of three of the other machines."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.data.recording import Recording, from_columns, read_recording
from regolithd.calibration.mismatch.simulation.load import load_simulation
from regolithd.calibration.validation.blind_trials.recordings.files import COLUMNS, recording_columns
from regolithd.calibration.validation.blind_trials.recordings.generator import Plan, make_trial
from regolithd.calibration.validation.blind_trials.recordings.out_of_library import OUT_OF_LIBRARY
from regolithd.calibration.validation.machine_trials.cases.files import write_recording, write_simulation
from regolithd.calibration.validation.machine_trials.cases.generator import make_case
from regolithd.calibration.validation.machine_trials.cases.plan import plan_case
from regolithd.calibration.validation.machine_trials.machines import MACHINES

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from regolithd.calibration.mismatch.simulation.simulation import Simulation

OTHER_MACHINES = ("servo-joint", "agv-drive", "propeller-stand")
"""Machines whose effects out of the library act on the output, as a function of a covariate or of time. Those of the
two tanks and of the oven act inside the simulation, and leave no function of a covariate on its output."""
RIGHT_FORM: dict[str, tuple[str, str]] = {
    "voltage": ("saturation", ""),
    "converter-loss": ("saturation", ""),
    "supply-ripple": ("saturation", ""),
    "side-hill": ("power", r"\(c roll\b(?! \^)"),
    "slope-drag": ("power", r"²|\^p"),
    "cable-spring": ("power", r"³|\^p"),
    "ground-effect": ("power", r"1/|\^p"),
    "resonance": ("bump", ""),
    "grease-peak": ("bump", ""),
    "grease-band": ("bump", ""),
    "hard-stop": ("threshold", ""),
    "sagging-tyre": ("threshold", ""),
}
"""Family of the law that the generator has, by kind of effect, and what the equation must contain. Kinds that are not
here happen at some times, and have no law over a covariate."""


@dataclass(frozen=True)
class Concealed:
    """One recording, the simulation without the effect, and the truth.

    Attributes
    ----------
    kind, covariate: of the effect
    channel: that it acts on
    true_rmse: what the true model leaves of that channel
    """

    machine: str
    kind: str
    covariate: str
    channel: str
    true_rmse: float
    recording: Recording
    simulation: Simulation

    def is_right(self, form: str, equation: str) -> bool:
        """Return whether a suggestion is the form of the concealed law."""
        family, pattern = RIGHT_FORM.get(self.kind, ("", ""))
        return form == family and re.search(pattern, equation) is not None


def rover_recordings(seed: int, of_each: int) -> Iterator[Concealed]:
    """Yield so many recordings of each kind of effect of the rover."""
    kinds = [kind for kind in OUT_OF_LIBRARY for _ in range(of_each)]
    for number, kind in enumerate(kinds):
        trial = make_trial(Plan(number, seed, "outside", (kind,)))
        (effect,) = trial.effects
        simulation = load_simulation(trial.tables)
        yield Concealed(
            machine="rover",
            kind=kind,
            covariate=effect.covariate,
            channel="motor_current_A",
            true_rmse=trial.true_rmse_A,
            recording=from_columns(dict(zip(COLUMNS, recording_columns(trial), strict=True))),
            simulation=simulation,
        )


def machine_recordings(seed: int, folder: Path) -> Iterator[Concealed]:
    """Yield a recording of each kind of effect of each of the other machines; files are written into the folder."""
    for machine in OTHER_MACHINES:
        for index in range(len(MACHINES[machine].outside)):
            case = make_case(plan_case(0, seed, machine, "outside", index))
            (effect,) = case.first.effects
            place = folder / f"{machine}-{index}"
            write_simulation(case.machine, case.units[0], place)
            path = write_recording(case.first, case.units[0], place / "recording.csv.gz")
            simulation = load_simulation(place / "SIM.toml")
            yield Concealed(
                machine=machine,
                kind=effect.kind,
                covariate=effect.covariate,
                channel=effect.channel,
                true_rmse=case.first.true_rmse(effect.channel),
                recording=read_recording(path, unit=simulation.wheel_column),
                simulation=simulation,
            )
