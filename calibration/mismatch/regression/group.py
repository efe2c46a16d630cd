"""Groups of columns, and a group on some wheels: what enters a regression as one."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape, Sharing
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.groups.region import Region

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Group:
    """Columns that enter together: one candidate in one shape, or a smooth term over a covariate.

    Attributes
    ----------
    name: the candidate's, or the covariate's
    columns: indices of its columns in the design matrix; they are adjacent
    signs: the coefficients' signs, 0 for either
    sharing: "all" and/or "one": wheels that may have it with the same coefficients
    selection_penalty: penalty, in Δχ², of its shape having been selected from many, and of an improbable shape
    candidate, shape: where it is a candidate's
    coupling: how a smooth term acts: "drag" (along the motion), "offset", "gain" (in proportion to the prediction), …
    noise_reduction: long-run variance of the noise over that at the frequencies of its columns, at least 1
    own_channel: for a fault of another channel, Δχ² and coefficient there, shape (wheel,) each
    acting: which column is other than zero on which wheel, shape (column, wheel); None: all on all
    region: the range of the covariate outside which its columns are zero; None: they act everywhere
    period: of a sine, in the unit of its covariate, which is seconds for time; None: it is none
    later: of a smooth term over what was before, the columns of what comes later, adjacent to its own and before them
    """

    name: str
    columns: tuple[int, ...]
    signs: tuple[int, ...]
    sharing: tuple[Sharing, ...]
    selection_penalty: float = 0.0
    candidate: Candidate | None = None
    shape: Shape = field(default_factory=dict)
    coupling: str = ""
    noise_reduction: float = 1.0
    own_channel: tuple[Array, Array] | None = None
    acting: NDArray[np.bool_] | None = None
    region: Region | None = None
    period: float | None = None
    later: tuple[int, ...] = ()

    @property
    def span(self) -> slice:
        """The slice of its columns."""
        return slice(self.columns[0], self.columns[-1] + 1)

    @property
    def is_change(self) -> bool:
        """Whether it is a change of an effect that the simulation was corrected by."""
        return self.candidate is not None and self.candidate.stated_size > 0

    @property
    def subject(self) -> tuple[str, object]:
        """What a wheel has once: an effect, and of delays the column that is late."""
        return self.name, self.shape.get("late")

    @property
    def law(self) -> tuple[str, bool]:
        """What tells candidates apart: a change of a corrected effect has the name of the effect itself."""
        return self.name, self.is_change

    @property
    def named(self) -> bool:
        """Whether it is a candidate, not a smooth term."""
        return self.candidate is not None

    def may_be_shared(self, kind: str) -> bool:
        """Return whether wheels of this kind may share it; what may be on one or on all may be on some."""
        return kind in self.sharing or (kind == "some" and self.named and len(self.sharing) > 1)


@dataclass(frozen=True)
class Term:
    """A group on some wheels, given by their indices."""

    group: Group
    wheels: tuple[int, ...]

    @property
    def name(self) -> str:
        """The candidate's or the covariate's."""
        return self.group.name

    @property
    def imitated_over(self) -> str:
        """The covariate over which a curve can imitate it; of a smooth term its own."""
        return self.group.candidate.imitated_over if self.group.candidate else self.name

    def settled_in(self, problem: Problem) -> bool:
        """Return whether it is the delay of an input that a problem has on time: what was found before it was posed."""
        return not self.group.is_change and self.group.shape.get("late") in problem.on_time


@dataclass(frozen=True)
class Fit:
    """Terms fitted together with the free parameters.

    Attributes
    ----------
    terms: what was fitted beside the free parameters
    columns: (column, wheels) of every coefficient, the free parameters' first
    coefficients: of the scaled columns, shape (coefficient,)
    covariance: of the coefficients, for white noise of the long-run variance, shape (coefficient, coefficient)
    delta_chi2: fall of the weighted sum of squares, penalised by the priors, below that of the free parameters alone
    """

    terms: tuple[Term, ...]
    columns: tuple[tuple[int, tuple[int, ...]], ...]
    coefficients: Array
    covariance: Array
    delta_chi2: float

    def of_term(self, index: int) -> slice:
        """Return the slice of a term's coefficients."""
        sizes = [len(term.group.columns) for term in self.terms]
        start = len(self.columns) - sum(sizes[index:])
        return slice(start, start + sizes[index])

    def without(self, index: int) -> tuple[Term, ...]:
        """Return all terms but one."""
        return (*self.terms[:index], *self.terms[index + 1 :])
