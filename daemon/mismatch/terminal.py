"""The answer as text on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape

if TYPE_CHECKING:
    from rich.console import Console

    from regolithd.calibration.mismatch.answer import Answer, Unexplained


def print_answer(console: Console, answer: Answer) -> None:
    """Print verdict, effects, what is unexplained or indistinguishable, the held-out error and the notes."""
    console.print(f"[bold]{answer.verdict}[/bold]")
    for line in _lines(answer):
        console.print(f"  {escape(line)}")


def sure_of(answer: Answer) -> str:
    """Return how probable the set of names is, and which other is next."""
    if answer.probability is None:
        return "probability of this set of names: not known"
    text = f"probability of this set of names: {answer.probability:.2f}"
    if (other := answer.next_best) is None:
        return text
    names = (*other.effects, *(("something unexplained",) if other.unexplained else ()))
    return f"{text}; next: {' + '.join(names) or 'nothing'} ({other.probability:.2f})"


def _curve_lines(rest: Unexplained) -> list[str]:
    """Return what an empirical curve brings, and the closed forms that may describe it."""
    if rest.curve is None:
        return []
    curve = rest.curve
    reach = f"{curve.at[0]:.4g} to {curve.at[-1]:.4g} {curve.covariate_unit}".strip()
    error = f"held-out error {curve.held_out_rmse_before:.5g} before, {curve.held_out_rmse_after:.5g} after"
    lines = [f"with an empirical curve over {rest.covariate}, {reach}: {error}"]
    for place, each in enumerate(rest.suggestions, 1):
        numbers = ", ".join(f"{name} = {one.value:.4g} {one.unit}" for name, one in each.parameters.items())
        lines.append(f"suggestion {place}: {each.equation}; {numbers}; held-out error {each.held_out_rmse:.5g}")
    return lines


def _lines(answer: Answer) -> list[str]:
    fit = answer.fit
    error = (
        f"held-out error of {fit.channel}: {fit.held_out_rmse_before:.5g} before, "
        f"{fit.held_out_rmse_after:.5g} after, noise floor {fit.noise_floor_rmse:.5g}"
    )
    return [
        *(f"{effect.name}: {effect.statement}" for effect in answer.effects),
        *(
            f"parameter {each.name}: {each.value:.4g} {each.unit} instead of {each.prior:.4g}, "
            f"{each.prior_stds_away:.1f} standard deviations of its prior away"
            for each in answer.parameters
            if each.beyond_prior()
        ),
        *(
            f"unexplained: {100 * rest.share_of_residual:.0f} % of the residual follows {rest.covariate} on "
            f"{', '.join(map(str, rest.wheels))}, {rest.from_s:.0f} to {rest.to_s:.0f} s"
            f"{f'; only {rest.range.statement}' if rest.range else ''}"
            for rest in answer.unexplained
        ),
        *(line for rest in answer.unexplained for line in _curve_lines(rest)),
        *(
            f"{' or '.join(pair.effects)}: this recording does not distinguish them. {pair.experiment}"
            for pair in answer.indistinguishable
        ),
        sure_of(answer),
        error,
        *(f"note: {note}" for note in answer.notes),
    ]
