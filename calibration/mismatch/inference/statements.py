"""The answer's sentence about one effect: what, on which wheels, since when, how large, and the error without it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.answer import Parameter
    from regolithd.calibration.mismatch.candidates.candidate import Candidate


def listed(items: Sequence[str]) -> str:
    """Return 'a', 'a and b', or 'a, b and c'."""
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}"


def capital(sentence: str) -> str:
    """Return the sentence with its first letter as a capital."""
    return sentence[:1].upper() + sentence[1:]


def plural(noun: str) -> str:
    """Return the plural: wheels, axes, bodies."""
    if noun.endswith("is"):
        return noun[:-2] + "es"
    if noun.endswith("y"):
        return noun[:-1] + "ies"
    return noun + "s"


def wheels_in_words(wheels: Sequence[int | str], of: int, kind: str = "wheel") -> str:
    """Return 'all 6 wheels', 'wheel 4', 'wheels 1, 3 and 5'; `kind` is the singular."""
    if len(wheels) == of:
        return f"all {of} {plural(kind)}"
    return f"{plural(kind) if len(wheels) > 1 else kind} {listed([str(wheel) for wheel in wheels])}"


def statement(
    candidate: Candidate,
    wheels: Sequence[int | str],
    of: int,
    parameters: Mapping[str, Parameter],
    errors: tuple[float, float],
    kind: str,
) -> str:
    """Return one sentence about an effect.

    Parameters
    ----------
    wheels: names of those that have it, of `of`; a column of the recording is a `kind` (wheel, axis, side)
    parameters: with `relative_size`, and `onset_s` where it has an onset
    errors: held-out root mean squares on these wheels without and with the effect
    """
    where = f", on {wheels_in_words(wheels, of, kind)}" if of > 1 else ""
    onset = parameters.get("onset_s")
    begins = f" from {onset.value:.0f} s on (90 % sure: {onset.low:.0f} to {onset.high:.0f} s)" if onset else ""
    return f"{capital(candidate.words)}{where}{begins}: {size_and_cost(parameters['relative_size'], errors)}."


def size_and_cost(size: Parameter, errors: tuple[float, float]) -> str:
    """Return how large an effect is over the mean reading, and what leaving it out costs."""
    costs = 100 * (errors[0] / errors[1] - 1) if errors[1] > 0 else 0.0
    return (
        f"{100 * size.value:.0f} % of the mean reading (90 % sure: {100 * size.low:.0f} to {100 * size.high:.0f} %); "
        f"left out, it makes the held-out error there {abs(costs):.1f} % {'larger' if costs >= 0 else 'smaller'}"
    )
