"""A candidate of the user's own with checks around its methods, as `checked.py` has them around a simulation."""

from __future__ import annotations

import inspect
from functools import partial
from typing import TYPE_CHECKING, Any

from regolithd.calibration.mismatch import candidates
from regolithd.calibration.mismatch.candidates.candidate import Candidate, Coefficient
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.simulation.user_code import array_of, called

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.candidates.candidate import Array, Shape
    from regolithd.calibration.mismatch.problem.predictor import Predictor
    from regolithd.calibration.mismatch.problem.problem import Problem

LIBRARY = candidates.__name__
STATED = ("name", "covariate", "equation", "words", "signature", "experiment", "source")
"""Text that every candidate states."""


class CheckedCandidate(Candidate):
    """A candidate around another: the same attributes, and methods whose errors are told with file and line."""

    def __init__(self, inner: Candidate) -> None:
        self.inner = inner
        for name in Candidate.__annotations__:
            setattr(self, name, getattr(inner, name))
        for name, method in vars(Candidate).items():
            if inspect.isfunction(method) and not name.startswith("_") and name not in vars(CheckedCandidate):
                setattr(self, name, partial(called, inner, name))

    @property  # type: ignore[misc]
    def __class__(self) -> type:
        """The inner object's class, so that `isinstance` tells what this is a view of."""
        return type(self.inner)

    def __reduce__(self) -> tuple[type[CheckedCandidate], tuple[Candidate]]:
        return CheckedCandidate, (self.inner,)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401  # whatever the class has of its own
        if name == "inner" or name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.inner, name)

    def form_for(self, simulation: Predictor) -> Candidate:
        """Return the candidate for a simulation, which is checked as this one is."""
        found = called(self.inner, "form_for", simulation)
        return self if found is self.inner else CheckedCandidate(found)

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return the columns for one shape, (column, time, wheel)."""
        found = called(self.inner, "columns", problem, shape)
        most = len(self.coefficients)
        count = min(len(found), most) if hasattr(found, "__len__") else most
        what = f"{type(self.inner).__name__}.columns, one for each of its coefficients,"
        return array_of(found, (count, *problem.mask.shape), what)


def checked_candidate(candidate: object, method: str) -> Candidate:
    """Return a candidate of the library as it is, and the user's own with checks around it.

    Raises
    ------
    SimulationError
        When it is no candidate, or does not state what a candidate must.
    """
    if isinstance(candidate, CheckedCandidate) or type(candidate).__module__.startswith(f"{LIBRARY}."):
        return candidate  # type: ignore[return-value]  # the library has nothing else
    kind = candidate.__name__ if isinstance(candidate, type) else type(candidate).__name__
    if not isinstance(candidate, Candidate):
        cure = f"write {kind}()" if isinstance(candidate, type) else f"it returned a {kind}"
        raise SimulationError(f"{method} must return candidates; {cure}")
    for name in STATED:
        if not isinstance(getattr(candidate, name, None), str):
            raise SimulationError(f'the candidate {kind} must state {name} = "…"')
    coefficients = getattr(candidate, "coefficients", None)
    if not isinstance(coefficients, tuple) or not all(isinstance(each, Coefficient) for each in coefficients):
        raise SimulationError(f'the candidate {kind} must state coefficients = (Coefficient("name", "unit"), …)')
    return CheckedCandidate(candidate)
