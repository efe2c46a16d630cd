"""Simulations of the rover that ask for a part of the library alone, to measure what a candidate costs.

They stand apart from the study, so that the process that is measured does not load the generator of recordings.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from regolithd.calibration.mismatch.simulation.rover_wheel import RoverWheel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate


class LimitedLibrary(RoverWheel):
    """The rover's simulation with the first `count` candidates of the library."""

    count: ClassVar[int]

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:
        """Return the first `count`."""
        return library[: self.count]


class TwoCandidates(LimitedLibrary):
    """Two candidates."""

    count = 2


class FourCandidates(LimitedLibrary):
    """Four candidates."""

    count = 4


class EightCandidates(LimitedLibrary):
    """Eight candidates."""

    count = 8


LIMITED = {2: TwoCandidates, 4: FourCandidates, 8: EightCandidates}
"""By the number of candidates."""
