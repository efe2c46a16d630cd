"""An effect with its numbers, as a corrected simulation has it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.candidates.candidate import Shape
    from regolithd.calibration.mismatch.problem.corrections.onset_clock import FoundIn
    from regolithd.calibration.mismatch.problem.corrections.size_posterior import SizePosterior


@dataclass(frozen=True)
class Contribution:
    """One effect's term in the corrected simulation: enough to add it to any recording.

    Attributes
    ----------
    shape: the candidate's shape parameters
    coefficients: one for each of its columns
    wheels: the names of the wheels that have it
    relative_std: relative standard deviation of its size
    shape_std: standard deviations of shape parameters, by name
    channel: the predicted channel that it acts on; empty where there is one alone
    found_in: the recording whose clock its onset is on; None: each recording's own
    posterior: of its size together with the simulation's parameters, from the recording in which it was found
    """

    name: str
    shape: Shape
    coefficients: tuple[float, ...]
    wheels: tuple[int | str, ...]
    relative_std: float = 0.0
    channel: str = ""
    shape_std: Mapping[str, float] = field(default_factory=dict)
    found_in: FoundIn | None = None
    posterior: SizePosterior | None = None
