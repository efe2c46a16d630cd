"""Sums of products of one interval of time, and the course of them: what is kept of a recording while it grows."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from regolithd.calibration.mismatch.online.left_out import LeftOutHere

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Interval:
    """What is compared in one interval of time.

    Attributes
    ----------
    start_s, end_s: from the recording's start
    columns: the simulation's tangents and then the laws, shape (column, time, wheel), 0 where nothing is compared
    residual: measured less the stated simulation, shape (time, wheel), 0 where nothing is compared
    mask: where readings are compared, shape (time, wheel)
    size: sum of the channel's magnitudes over them
    left_out: readings that are not compared
    stuck_before: where a reading of the interval before is found to be stuck now, shape (time, wheel) of that; None:
        nowhere
    """

    start_s: float
    end_s: float
    columns: Array
    residual: Array
    mask: NDArray[np.bool_]
    size: float
    left_out: tuple[LeftOutHere, ...] = ()
    stuck_before: NDArray[np.bool_] | None = None

    def without(self, where: NDArray[np.bool_]) -> Interval:
        """Return the interval without readings, shape (time, wheel) or what broadcasts to it."""
        mask = self.mask & ~where
        share = mask.sum() / max(self.mask.sum(), 1)
        return replace(
            self,
            columns=np.where(mask, self.columns, 0.0),
            residual=np.where(mask, self.residual, 0.0),
            mask=mask,
            size=self.size * float(share),
        )

    def left_by(self, coefficients: Array) -> Array:
        """Return the residual less the columns at coefficients of shape (column, wheel)."""
        return self.residual - np.einsum("cw,ctw->tw", coefficients, self.columns)


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums over the readings of an interval that are compared; they add up.

    Attributes
    ----------
    gram: products of columns, shape (wheel, column, column)
    moment: products of columns with the residual, shape (wheel, column)
    acting: readings at which a column is not 0, shape (wheel, column)
    size, readings: sum of the channel's magnitudes, and readings
    """

    gram: Array
    moment: Array
    acting: Array
    size: float
    readings: float

    def __add__(self, other: Sums) -> Sums:
        """Return the sums over both."""
        return Sums(
            self.gram + other.gram,
            self.moment + other.moment,
            self.acting + other.acting,
            self.size + other.size,
            self.readings + other.readings,
        )


def sums_of(interval: Interval) -> Sums:
    """Return the sums of one interval."""
    by_wheel = np.ascontiguousarray(np.moveaxis(interval.columns, 2, 0))
    return Sums(
        gram=by_wheel @ np.swapaxes(by_wheel, 1, 2),
        moment=np.einsum("wct,tw->wc", by_wheel, interval.residual),
        acting=np.count_nonzero(by_wheel, axis=2).astype(np.float64),
        size=interval.size,
        readings=float(interval.mask.sum()),
    )


@dataclass(frozen=True, eq=False)
class Segment:
    """The sums from one time on, up to the next segment."""

    start_s: float
    sums: Sums


@dataclass(frozen=True, eq=False)
class Suffixes:
    """Sums from each segment's start to now: what a law that began there is fitted to.

    Attributes
    ----------
    starts_s: shape (segment,)
    gram, moment, acting: as in `Sums`, shape (segment, wheel, …)
    mean_size: the channel's mean magnitude since the start
    """

    starts_s: Array
    gram: Array
    moment: Array
    acting: Array
    mean_size: float

    def without(self, wheels: Sequence[int], onset_s: float) -> Suffixes:
        """Return the sums without the readings of some wheels from the start of a segment on."""
        first = int(np.flatnonzero(self.starts_s == onset_s)[0])
        later = np.maximum(np.arange(len(self.starts_s)), first)

        def before(sums: Array) -> Array:
            found = sums.copy()
            found[:, list(wheels)] -= sums[later][:, list(wheels)]
            return found

        return replace(self, gram=before(self.gram), moment=before(self.moment), acting=before(self.acting))


@dataclass
class Course:
    """Segments of time, in their order, at most `most`: old ones are merged, so that memory does not grow."""

    most: int
    segments: list[Segment] = field(default_factory=list)
    _suffixes: Suffixes | None = None

    def add(self, start_s: float, sums: Sums, kept_s: Collection[float] = ()) -> None:
        """Append an interval; where there are too many segments, two neighbours become one.

        Those whose common length is the smallest share of their age: an onset long ago is known less precisely anyway.
        The boundaries at `kept_s`, of changes that were reported, stay.
        """
        self._suffixes = None
        self.segments.append(Segment(start_s, sums))
        while len(self.segments) > self.most:
            shares = [self._share_of_age(at, kept_s) for at in range(1, len(self.segments) - 1)]
            at = int(np.argmin(shares)) + 1
            before, after = self.segments[at - 1 : at + 1]
            self.segments[at - 1 : at + 1] = [Segment(before.start_s, before.sums + after.sums)]

    def replace_last(self, sums: Sums) -> None:
        """Put other sums in the place of the interval that was appended last."""
        self._suffixes = None
        self.segments[-1] = Segment(self.segments[-1].start_s, sums)

    def _share_of_age(self, at: int, kept_s: Collection[float]) -> float:
        """Return the length of a segment and the one before it over their age; infinite where they stay apart."""
        if self.segments[at].start_s in kept_s:
            return float("inf")
        now, begin, end = (self.segments[k].start_s for k in (-1, at - 1, at + 1))
        return (end - begin) / max(now - begin, 1e-9)

    def suffixes(self) -> Suffixes:
        """Return the sums from each segment's start to now."""
        if self._suffixes is None:
            self._suffixes = self._made_suffixes()
        return self._suffixes

    def _made_suffixes(self) -> Suffixes:
        every = [segment.sums for segment in self.segments]
        from_here = [np.cumsum(np.stack(part)[::-1], axis=0)[::-1] for part in zip(*map(_arrays, every), strict=True)]
        gram, moment, acting = from_here
        size, readings = sum(each.size for each in every), sum(each.readings for each in every)
        starts_s = np.array([segment.start_s for segment in self.segments])
        return Suffixes(starts_s, gram, moment, acting, size / max(readings, 1.0))


def _arrays(sums: Sums) -> tuple[Array, Array, Array]:
    return sums.gram, sums.moment, sums.acting
