"""The grammar of closed forms: functions of one covariate that occur in laws, each with at most two shape parameters.

A form is a coefficient (two for a sine) times a function of the covariate x, with or without a constant beside it. It
knows no machine: a constant, powers, an exponential, saturation, a bump, a threshold, a step and a sine are what laws
of friction, fluids, magnets and contacts are made of near one working point.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Callable

Array = NDArray[np.float64]

AWAY_FROM_ZERO = 0.05
"""Least magnitude of the covariate, over the greatest, for forms that are infinite at zero (a choice)."""
NARROWEST, WIDEST = 0.015, 3.0
"""Widths and lengths that are searched, as shares of the covariate's range (a choice: from half of a knot of a curve,
for a bump in the place of a narrow band, to what is all but a straight line)."""
FEWEST_CYCLES, MOST_CYCLES = 0.5, 24.0
"""Cycles of a sine within the range (a choice: fewer are a parabola; more are not looked for, see
`regression/groups/smooth_groups.py`)."""
TRIED_A_CYCLE = 6
"""Points of the grid for each further cycle (a choice: what is found is refined)."""
VALUES_A_CYCLE = 3
"""Values of a covariate that has few, in each cycle of a sine (a choice: one more than Nyquist's two)."""
WIDTHS, PLACES = 12, 21
"""Points of the grids, refined afterwards (a choice)."""


@dataclass(frozen=True)
class Span:
    """The ends of the covariate in a recording, and the least magnitude that it has.

    Attributes
    ----------
    usual_step: half of the range is crossed in steps of at most this; of gears it is 1, and one gap hardly changes it
    """

    low: float
    high: float
    least: float
    usual_step: float = 0.0

    @property
    def width(self) -> float:
        """The range."""
        return self.high - self.low

    @property
    def narrowest(self) -> float:
        """The least width or length: what is narrower could lie between two values, and have any size there."""
        return max(NARROWEST * self.width, self.usual_step / 4)

    @property
    def most_cycles(self) -> float:
        """The most cycles that show: at two values a cycle, a sine and its phase are one number."""
        step = VALUES_A_CYCLE * self.usual_step
        return min(MOST_CYCLES, self.width / step if step > 0 else MOST_CYCLES)

    @property
    def both_signs(self) -> bool:
        """Whether the covariate has either sign."""
        return self.low < 0 < self.high

    @property
    def away_from_zero(self) -> bool:
        """Whether it has one sign and keeps away from zero."""
        return not self.both_signs and self.least > AWAY_FROM_ZERO * max(abs(self.low), abs(self.high))


@dataclass(frozen=True)
class ClosedForm:
    """One form of the grammar.

    Attributes
    ----------
    family: forms that differ by an exponent or a sign alone have one family, and are suggested once
    text: the function, with x for the covariate and c for its coefficient
    of: the function of x [bin] and the shape parameters, shape (column, bin)
    shapes: the grid of the shape parameters over a span, shape (shape, parameter)
    names: the shape parameters; a has the unit of x, as k has, p none
    exponent: by which the coefficient's unit is divided by that of x; 0: it has the unit of the values
    suits: whether it can be told from others on a span
    coefficients: names of its linear factors
    usual: whether it needs no choice among exponents: a straight line is tried first
    """

    family: str
    text: str
    of: Callable[[Array, Array], Array]
    shapes: Callable[[Span], Array] = lambda _: np.zeros((1, 0))
    names: tuple[str, ...] = ()
    exponent: float = 0.0
    suits: Callable[[Span], bool] = lambda _: True
    coefficients: tuple[str, ...] = ("c",)
    usual: bool = True


def grammar() -> tuple[ClosedForm, ...]:
    """Return every form."""
    return (_constant(), *_powers(), *_bounded(), *_thresholds(), _sine())


def _constant() -> ClosedForm:
    """Return a constant: of what acts in proportion to the prediction it is a share of that."""
    return ClosedForm("constant", "c", lambda x, _: np.ones((1, len(x))))


def _powers() -> list[ClosedForm]:
    """Return powers with the exponents of usual laws, and with a free one; odd (with the sign of x) and even."""
    usual = {0.5: "√|x|", 1.0: "|x|", 2.0: "x²", 3.0: "|x|³"}
    odd = {0.5: "√|x| sign(x)", 1.0: "x", 2.0: "|x| x", 3.0: "x³"}
    inverse = {-1.0: "1/x", -2.0: "1/x²"}
    # On one side of zero an odd power is an even one or its negative.
    even = [_power(p, text, signed=False, suits=_both_signs if p == 1 else None) for p, text in usual.items()]
    found = even + [_power(p, text, signed=True, suits=None if p == 1 else _both_signs) for p, text in odd.items()]
    found += [_power(p, text, signed=False, suits=_away_from_zero) for p, text in inverse.items()]
    for signed, text in ((False, "c |x|^p"), (True, "c |x|^p sign(x)")):
        found.append(
            ClosedForm(
                "power",
                text,
                partial(_free_power, signed=signed),
                _exponents,
                ("p",),
                suits=_both_signs if signed else _anywhere,
            )
        )
    return found


def _power(exponent: float, text: str, *, signed: bool, suits: Callable[[Span], bool] | None) -> ClosedForm:
    def of(x: Array, _: Array) -> Array:
        size = np.abs(x) ** exponent
        return np.asarray((np.sign(x) * size if signed or exponent == -1 else size)[None])

    return ClosedForm(
        "power", f"c {text}", of, exponent=exponent, suits=suits or _anywhere, usual=exponent == 1 and signed
    )


def _free_power(x: Array, shape: Array, *, signed: bool) -> Array:
    size = np.maximum(np.abs(x), 1e-300) ** shape[0]
    return np.asarray((np.sign(x) * size if signed else size)[None])


def _exponents(span: Span) -> Array:
    low = -4.0 if span.away_from_zero else 0.2
    return np.linspace(low, 5.0, 25)[:, None]


def _bounded() -> list[ClosedForm]:
    """Return forms that come to rest: exponential, saturation, bump."""
    return [
        ClosedForm("exponential", "c exp(x/k)", partial(_exponential, sign=1.0), _widths, ("k",)),
        ClosedForm("exponential", "c exp(−x/k)", partial(_exponential, sign=-1.0), _widths, ("k",)),
        ClosedForm("saturation", "c tanh(x/k)", lambda x, s: np.tanh(x / s[0])[None], _widths, ("k",)),
        ClosedForm("saturation", "c tanh((x − a)/k)", _shifted_tanh, _places, ("a", "k")),
        ClosedForm("bump", "c exp(−((x − a)/k)²/2)", _bump, _places, ("a", "k")),
    ]


def _shifted_tanh(x: Array, shape: Array) -> Array:
    return np.asarray(np.tanh((x - shape[0]) / shape[1])[None])


def _bump(x: Array, shape: Array) -> Array:
    return np.asarray(np.exp(-(((x - shape[0]) / shape[1]) ** 2) / 2)[None])


def _exponential(x: Array, shape: Array, *, sign: float) -> Array:
    # Beyond that it is no number any more.
    return np.asarray(np.exp(np.clip(sign * x / shape[0], -300, 300))[None])


def _thresholds() -> list[ClosedForm]:
    """Return forms that begin at a value of x: linear, quadratic, a step, and a dead zone about zero."""
    found = []
    for power, mark in ((1, ""), (2, "²")):
        above, below = partial(_beyond, power=power, sign=1.0), partial(_beyond, power=power, sign=-1.0)
        outside = partial(_outside, power=power, signed=False)
        odd = partial(_outside, power=power, signed=True)
        found += [
            ClosedForm("threshold", f"c max(x − a, 0){mark}", above, _inner, ("a",), power),
            ClosedForm("threshold", f"c max(a − x, 0){mark}", below, _inner, ("a",), power),
            ClosedForm("threshold", f"c max(|x| − a, 0){mark}", outside, _magnitudes, ("a",), power, _both_signs),
            ClosedForm("threshold", f"c sign(x) max(|x| − a, 0){mark}", odd, _magnitudes, ("a",), power, _both_signs),
        ]
    step = ClosedForm("step", "c where x > a", lambda x, s: (x > s[0]).astype(np.float64)[None], _inner, ("a",))
    return [*found, step]


def _beyond(x: Array, shape: Array, *, power: int, sign: float) -> Array:
    return np.asarray((np.maximum(sign * (x - shape[0]), 0.0) ** power)[None])


def _outside(x: Array, shape: Array, *, power: int, signed: bool) -> Array:
    size = np.maximum(np.abs(x) - shape[0], 0.0) ** power
    return np.asarray((np.sign(x) * size if signed else size)[None])


def _sine() -> ClosedForm:
    return ClosedForm(
        "sine",
        "c cos(2π x/k) + d sin(2π x/k)",
        lambda x, s: np.stack((np.cos(2 * np.pi * x / s[0]), np.sin(2 * np.pi * x / s[0]))),
        _periods,
        ("k",),
        suits=lambda span: span.most_cycles > FEWEST_CYCLES,
        coefficients=("c", "d"),
    )


def _periods(span: Span) -> Array:
    points = 2 + int(TRIED_A_CYCLE * (span.most_cycles - FEWEST_CYCLES))
    return np.asarray((span.width / np.linspace(FEWEST_CYCLES, span.most_cycles, points))[:, None])


def _anywhere(_: Span) -> bool:
    return True


def _both_signs(span: Span) -> bool:
    return span.both_signs


def _away_from_zero(span: Span) -> bool:
    return span.away_from_zero


def _widths(span: Span) -> Array:
    return np.geomspace(span.narrowest, WIDEST * span.width, 2 * WIDTHS)[:, None]


def _places(span: Span) -> Array:
    at, wide = np.linspace(span.low, span.high, PLACES), np.geomspace(span.narrowest, WIDEST * span.width, WIDTHS)
    return np.stack([each.ravel() for each in np.meshgrid(at, wide)], axis=1)


def _inner(span: Span) -> Array:
    return np.linspace(span.low, span.high, 2 * PLACES + 2)[1:-1, None]


def _magnitudes(span: Span) -> Array:
    return np.linspace(0, max(-span.low, span.high), PLACES + 1)[1:-1, None]
