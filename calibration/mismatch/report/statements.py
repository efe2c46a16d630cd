"""The answer in plain sentences: what, where, how big, how sure, and what it costs to leave out."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.answer import Parameter
    from regolithd.calibration.mismatch.candidates.candidate import Candidate


def wheels_in_words(wheels: Sequence[int], of: int, kind: str = "wheel") -> str:
    """Return 'all 6 wheels', 'wheel 4', 'wheels 1, 3 and 5'."""
    if len(wheels) == of:
        return f"all {of} {kind}s" if of > 1 else f"the {kind}"
    if len(wheels) == 1:
        return f"{kind} {wheels[0]}"
    return f"{kind}s {', '.join(map(str, wheels[:-1]))} and {wheels[-1]}"


def statement(
    candidate: Candidate,
    wheels: Sequence[int],
    of: int,
    parameters: Mapping[str, Parameter],
    errors: tuple[float, float],
    kind: str,
) -> str:
    """Return one sentence about an effect."""
    size = parameters["relative_size"]
    where = wheels_in_words(wheels, of, kind)
    onset = parameters.get("onset_s")
    begins = f" from {onset.value:.0f} s on (90 % sure: {onset.low:.0f} to {onset.high:.0f} s)" if onset else ""
    costs = 100 * (errors[0] / errors[1] - 1) if errors[1] > 0 else 0.0
    words = candidate.words[:1].upper() + candidate.words[1:]
    return (
        f"{words}, on {where}{begins}: {100 * size.value:.0f} % of the mean reading "
        f"(90 % sure: {100 * size.low:.0f} to {100 * size.high:.0f} %); "
        f"left out, it makes the held-out error there {costs:.1f} % larger."
    )
