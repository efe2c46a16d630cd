"""Viscous friction as in the literature on this axis: proportional to speed."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from regolithd.calibration.mismatch.candidates.viscous_friction import ViscousFriction

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch import Problem, Shape


class LinearFriction(ViscousFriction):
    """The library's viscous friction with its power held at 1, so that the coefficient can be compared."""

    equation = "F = b v"
    free: ClassVar[Mapping[str, tuple[float, float]]] = {}

    def shapes(self, problem: Problem) -> Sequence[Shape]:  # noqa: ARG002  # it has one
        """Return the one shape."""
        return [{"power": 1.0}]
