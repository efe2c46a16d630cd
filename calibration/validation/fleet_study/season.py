"""The recordings of a season: five virtual rovers, what each conceals, and since when."""

from __future__ import annotations

import gzip
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.validation.blind_trials.recordings.concealed_effect import (
    ConcealedEffect,
    TrueModel,
    of_strength,
    on_wheels,
    relative_strength,
)
from regolithd.calibration.validation.blind_trials.recordings.files import recording_text, toml_text
from regolithd.calibration.validation.blind_trials.recordings.generator import (
    Plan,
    rover_traverse,
    simulation_tables,
    true_model,
    with_noise,
)
from regolithd.calibration.validation.blind_trials.recordings.library_effects import LIBRARY_EFFECTS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.random import Generator

    from regolithd.calibration.validation.blind_trials.recordings.generator import Tables, Trial

START = datetime(2026, 1, 5, 9, 0, tzinfo=UTC)
DAYS = 200.0
"""Length of the season."""
STEP_S = 0.2


@dataclass(frozen=True)
class Concealed:
    """What a rover conceals.

    Attributes
    ----------
    name: the candidate that it is called by
    law: the generator's effect with its course in time left out
    wheels: that have it
    since: share of the season after which it begins; 0: from the start
    grows: whether it grows to its full size until the end of the season, or is there at once
    strength: root mean square where it acts on a typical drive, over the mean current there
    """

    name: str
    law: str
    wheels: tuple[int, ...]
    since: float
    grows: bool
    strength: float


ALL = (1, 2, 3, 4, 5, 6)
ROVERS: dict[str, Concealed | None] = {
    "asper": Concealed("bearing-drag", "coulomb-friction", (4,), 0.35, True, 0.5),
    "bruno": Concealed("bearing-drag", "coulomb-friction", (1,), 0.6, True, 0.5),
    "cleo": Concealed("cold-lubricant-friction", "cold-lubricant-friction", ALL, 0.0, False, 0.15),
    "dara": Concealed("viscous-friction", "viscous-friction", ALL, 0.5, False, 0.15),
    "emil": None,
}
"""The rovers of the season by name."""


@dataclass(frozen=True)
class Drive:
    """One recording of the season.

    Attributes
    ----------
    rover, begins: who and when
    share: of the season that is over
    size: of what is concealed, relative to its full size
    """

    rover: str
    begins: datetime
    share: float
    size: float

    @property
    def file(self) -> str:
        """Name in the season's folder."""
        return f"{self.rover}/{self.begins:%Y%m%dT%H%M%SZ}.csv.gz"


def drives(per_rover: int) -> list[Drive]:
    """Return the drives of the season, evenly spread, an hour apart from rover to rover."""
    found = []
    for place, (rover, concealed) in enumerate(ROVERS.items()):
        for number in range(per_rover):
            share = (number + 0.5) / per_rover
            begins = START + timedelta(days=round(DAYS * share), hours=place)
            found.append(Drive(rover, begins, share, _size(concealed, share)))
    return found


def _size(concealed: Concealed | None, share: float) -> float:
    if concealed is None or share < concealed.since:
        return 0.0
    return (share - concealed.since) / (1 - concealed.since) if concealed.grows else 1.0


def season_tables(seed: int) -> Tables:
    """Return SIM.toml's tables: one simulation for all rovers."""
    return simulation_tables(np.random.default_rng([seed, 0]))


def trial_of(seed: int, number: int, drive: Drive, duration_s: float) -> Trial:
    """Return one drive as measured. A rover keeps its parameters and its effect's law; way and noise are new."""
    rng, concealed = np.random.default_rng([seed, 2, number]), ROVERS[drive.rover]
    model, effects = _on_a_way(seed, drive.rover, rng, duration_s), tuple[ConcealedEffect, ...]()
    if concealed is not None and drive.size:
        size = drive.size * _full_size(seed, drive.rover, concealed, duration_s)
        law = _law(seed, drive.rover, concealed, model)
        effects = (replace(law, size=size, strength=relative_strength(model, law, size)),)
    return with_noise(rng, Plan(number, seed, "fleet", ()), model, season_tables(seed), effects)


def _on_a_way(seed: int, rover: str, way: Generator, duration_s: float) -> TrueModel:
    """Return a rover's true model on a way of its own."""
    tables = season_tables(seed)
    traverse = rover_traverse(way, "patrol", tables, duration_s, STEP_S)
    return true_model(np.random.default_rng([seed, 1, list(ROVERS).index(rover)]), tables, traverse)


@cache
def _full_size(seed: int, rover: str, concealed: Concealed, duration_s: float) -> float:
    """Return the size at which a rover's law has the stated strength on a typical drive.

    It is the same on all drives: a coefficient does not depend on how cold a day is.
    """
    typical = _on_a_way(seed, rover, np.random.default_rng([seed, 4, list(ROVERS).index(rover)]), duration_s)
    strength = concealed.strength * (len(concealed.wheels) / 6) ** 0.5
    return of_strength(typical, _law(seed, rover, concealed, typical), strength).size


def _law(seed: int, rover: str, concealed: Concealed, model: TrueModel) -> ConcealedEffect:
    """Return a rover's law on a drive, of no size yet."""
    law = LIBRARY_EFFECTS[concealed.law](np.random.default_rng([seed, 3, list(ROVERS).index(rover)]), model)
    if len(concealed.wheels) == 1:
        on = on_wheels(concealed.wheels)
        law = replace(law, added_current_A=lambda at: at * model.traverse.rotation * on)
    return replace(law, wheels=concealed.wheels)


def write_season(folder: Path, seed: int, per_rover: int, duration_s: float) -> Iterator[Path]:
    """Write SIM.toml and every recording that is not there yet; yield the recordings' paths."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "SIM.toml").write_text(toml_text(season_tables(seed)))
    for number, drive in enumerate(drives(per_rover)):
        path = folder / drive.file
        path.parent.mkdir(exist_ok=True)
        if not path.is_file():
            text = recording_text(trial_of(seed, number, drive, duration_s))
            path.write_bytes(gzip.compress(text.encode(), compresslevel=3, mtime=0))
        yield path
