"""What a run of the loop came to: one plain sentence, and flat figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.daemon.closed_loop.reading import UNITS, figures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.daemon.closed_loop.close import Closed


def concealed(closed: Closed) -> str:
    """Return what was concealed, in words."""
    hidden = closed.case.hidden
    if "no_load_current_A" in hidden:
        return f"{1e3 * hidden['no_load_current_A']:.1f} mA of constant friction"
    if "viscous_current_A_s_per_rad" in hidden:
        return f"{1e6 * hidden['viscous_current_A_s_per_rad']:.1f} µA s/rad of viscous friction"
    return "nothing"


def found(closed: Closed) -> str:
    """Return what was found, in words and with its numbers as the daemon now has them."""
    if not closed.names:
        return {"consistent": "nothing", "unexplained": "something without a name"}[closed.answer["verdict"]]
    drivetrain = closed.configuration.drivetrain
    current, viscous = drivetrain.no_load_current_A[0], drivetrain.viscous_current_A_s_per_rad[0]
    now = f"I₀ = {1e3 * current:.1f} mA" + (f" + {1e6 * viscous:.1f} µA s/rad · ω" if viscous else "")
    return f"{' and '.join(closed.names)} ({now})"


def sentence(closed: Closed) -> str:
    """Return the run in one line for a person."""
    before, after = figures(closed.before), figures(closed.after)
    errors = " and ".join(
        f"{symbol} {before[f'posterior_rmse_{unit}']:.2f} → {after[f'posterior_rmse_{unit}']:.2f} {shown}"
        for symbol, unit, shown in zip(("c", "φ"), UNITS, ("kPa", "°"), strict=True)
    )
    outcome = f"rover.toml corrected; error on other soils: {errors}" if closed.says else "rover.toml stays as it was"
    return f"Concealed {concealed(closed)}; found {found(closed)}; {outcome}."


def figures_of(runs: Sequence[Closed]) -> dict[str, float | str | bool]:
    """Return every figure of every run, flat."""
    flat: dict[str, float | str | bool] = {}
    for closed in runs:
        name = closed.case.name
        flat[f"{name}_verdict"] = closed.answer["verdict"]
        flat[f"{name}_named"] = " ".join(closed.names)
        flat[f"{name}_right"] = closed.names == closed.case.names
        flat[f"{name}_corrected_simulation_verdict"] = closed.again["verdict"]
        flat[f"{name}_configuration_changed"] = bool(closed.says)
        for term in ("no_load_current_A", "viscous_current_A_s_per_rad"):
            flat[f"{name}_concealed_{term}"] = closed.case.hidden.get(term, 0.0)
            now, known = getattr(closed.configuration.drivetrain, term)[0], closed.case.known.get(term, 0.0)
            flat[f"{name}_found_{term}"] = now - known
        fit = closed.answer["fit"]
        flat[f"{name}_held_out_rmse_before_A"] = fit["held_out_rmse_before"]
        flat[f"{name}_held_out_rmse_after_A"] = fit["held_out_rmse_after"]
        for when, reading in (("before", closed.before), ("after", closed.after), ("told", closed.told)):
            flat |= {f"{name}_{when}_{key}": value for key, value in figures(reading).items()}
    return flat
