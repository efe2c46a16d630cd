"""The outcome of a case: one sentence for people, and figures by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.daemon.closed_loop.soil_estimates import UNITS, figures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.daemon.closed_loop.run import LoopResult


def hidden_effect(result: LoopResult) -> str:
    """Return the hidden effect in words."""
    hidden = result.case.hidden
    if "no_load_current_A" in hidden:
        return f"{1e3 * hidden['no_load_current_A']:.1f} mA of constant friction"
    if "viscous_current_A_s_per_rad" in hidden:
        return f"{1e6 * hidden['viscous_current_A_s_per_rad']:.1f} µA s/rad of viscous friction"
    return "nothing"


def found_effect(result: LoopResult) -> str:
    """Return the named effects in words, with the corrected no-load current."""
    if not result.names:
        return {"consistent": "nothing", "unexplained": "an unexplained difference"}[result.answer["verdict"]]
    drivetrain = result.configuration.drivetrain
    current, viscous = drivetrain.no_load_current_A[0], drivetrain.viscous_current_A_s_per_rad[0]
    now = f"I₀ = {1e3 * current:.1f} mA" + (f" + {1e6 * viscous:.1f} µA s/rad · ω" if viscous else "")
    return f"{' and '.join(result.names)} ({now})"


def sentence(result: LoopResult) -> str:
    """Return the outcome in one sentence."""
    before, after = figures(result.before), figures(result.after)
    errors = " and ".join(
        f"{symbol} {before[f'posterior_rmse_{unit}']:.2f} → {after[f'posterior_rmse_{unit}']:.2f} {shown}"
        for symbol, unit, shown in zip(("c", "φ"), UNITS, ("kPa", "°"), strict=True)
    )
    outcome = f"rover.toml corrected; error on other soils: {errors}" if result.changes else "rover.toml unchanged"
    return f"Hidden: {hidden_effect(result)}; found: {found_effect(result)}; {outcome}."


def figures_of(runs: Sequence[LoopResult]) -> dict[str, float | str | bool]:
    """Return every figure of every case, by name."""
    flat: dict[str, float | str | bool] = {}
    for result in runs:
        name = result.case.name
        flat[f"{name}_verdict"] = result.answer["verdict"]
        flat[f"{name}_named"] = " ".join(result.names)
        flat[f"{name}_right"] = result.names == result.case.names
        flat[f"{name}_corrected_simulation_verdict"] = result.corrected_answer["verdict"]
        flat[f"{name}_configuration_changed"] = bool(result.changes)
        for term in ("no_load_current_A", "viscous_current_A_s_per_rad"):
            flat[f"{name}_hidden_{term}"] = result.case.hidden.get(term, 0.0)
            now, known = getattr(result.configuration.drivetrain, term)[0], result.case.known.get(term, 0.0)
            flat[f"{name}_found_{term}"] = now - known
        fit = result.answer["fit"]
        flat[f"{name}_held_out_rmse_before_A"] = fit["held_out_rmse_before"]
        flat[f"{name}_held_out_rmse_after_A"] = fit["held_out_rmse_after"]
        by_configuration = (
            ("before", result.before),
            ("after", result.after),
            ("true_drivetrain", result.with_true_drivetrain),
        )
        for when, estimates in by_configuration:
            flat |= {f"{name}_{when}_{key}": value for key, value in figures(estimates).items()}
    return flat
