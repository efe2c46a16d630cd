"""The report: one HTML file that opens offline and can be handed to a review board.

It is a view of an `Answer` and its `Evidence` and adds nothing to them. No script, no font, no picture is fetched; the
drawings are SVG in the page and follow its colours, light, dark and on paper. The same answer gives the same bytes.
"""

from __future__ import annotations

import platform
from dataclasses import dataclass
from html import escape
from importlib import metadata, resources
from string import Template
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.report.axes import number
from regolithd.calibration.mismatch.report.curves import curve_of
from regolithd.calibration.mismatch.report.figures import (
    covariate_label,
    curve_figure,
    fit_figure,
    interval_figure,
    map_figure,
    scaled,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from regolithd.calibration.mismatch.answer import Answer, Curve, Effect, Evidence, Unexplained

COMPARED = ("numpy", "scipy", "pyarrow")
"""Packages whose versions a repetition would want to know."""


PARAMETERS = {
    "onset_s": "onset",
    "relative_size": "share of the mean reading",
    "rise_s": "rise",
    "scale_K": "temperature scale",
}
"""Parameters whose names read better in other words."""


@dataclass(frozen=True)
class Provenance:
    """Where the answer came from: names and SHA-256 of the two files, and the command that was given."""

    recording: str
    simulation: str
    recording_sha256: str
    simulation_sha256: str
    command: str = ""


def write_report(path: Path, answer: Answer, evidence: Evidence, provenance: Provenance) -> None:
    """Write the report."""
    path.write_text(render_report(answer, evidence, provenance), encoding="utf-8")


def render_report(answer: Answer, evidence: Evidence, provenance: Provenance) -> str:
    """Return the report as one HTML document."""
    template = resources.files("regolithd.calibration.mismatch.report").joinpath("report.html").read_text("utf-8")
    sections = (
        _header(answer, evidence, provenance),
        _where(answer, evidence),
        _effects(answer, evidence),
        _unexplained(answer, evidence),
        _fit(answer, evidence),
        _indistinguishable(answer),
        _sensitivity(answer, evidence),
        _other_curves(answer, evidence),
        _method(answer, provenance),
    )
    title = escape(f"{verdict_sentence(answer)} – {provenance.recording}")
    return Template(template).substitute(title=title, body="\n".join(sections))


def words(name: str) -> str:
    """Return an effect's name as it is spoken: 'multi-pass compaction', 'Coulomb friction'."""
    spaced = " ".join(name.rsplit("-", 1)).replace("_", " ")
    return spaced.replace("coulomb", "Coulomb").replace("stribeck", "Stribeck")


def capital(sentence: str) -> str:
    """Return the words with a capital letter in front, the others as they are."""
    return sentence[:1].upper() + sentence[1:]


def listed(items: Sequence[str]) -> str:
    """Return 'a', 'a and b', or 'a, b and c'."""
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}"


def wheels_in_words(wheels: Sequence[int], everything: Sequence[int]) -> str:
    """Return which wheels: all of them, one, or a list."""
    if len(wheels) == len(everything):
        return "every wheel" if len(everything) > 1 else ""
    return f"wheel {wheels[0]}" if len(wheels) == 1 else f"wheels {listed([str(wheel) for wheel in wheels])}"


def which_wheels(wheels: Sequence[int], everything: Sequence[int]) -> str:
    """Return the wheels as a short label."""
    if len(wheels) == len(everything) > 1:
        return f"all {len(wheels)} wheels"
    return f"wheel {wheels[0]}" if len(wheels) == 1 else f"wheels {', '.join(map(str, wheels))}"


def spoken(covariate: str) -> str:
    """Return a covariate as it is spoken, without its unit."""
    return covariate_label(covariate).split(" (")[0]


def verdict_sentence(answer: Answer) -> str:
    """Return the verdict in one sentence."""
    names = list(dict.fromkeys(words(effect.name) for effect in answer.effects))
    if answer.verdict == "consistent":
        return "Simulation and recording agree to within the noise."
    if answer.verdict == "missing-physics":
        return f"The simulation leaves out {listed(names)}."
    places = list(dict.fromkeys(spoken(place.covariate) for place in answer.unexplained))
    place = f" that goes with {listed(places)}" if places else ""
    if names:
        return f"The simulation leaves out {listed(names)} – and something{place} that no known effect explains."
    return f"The simulation leaves out something{place}, and no known effect explains it."


def _header(answer: Answer, evidence: Evidence, provenance: Provenance) -> str:
    minutes = float(evidence.time_s[-1] - evidence.time_s[0]) / 60
    values = int(np.isfinite(evidence.before).sum())
    many = f"<span><b>{len(evidence.wheels)}</b> wheels</span>" if len(evidence.wheels) > 1 else ""
    return f"""<header>
<p class="kicker">Simulation against recording · mismatch report</p>
<h1>{escape(verdict_sentence(answer))}</h1>
<p class="about"><span>recording <b>{escape(provenance.recording)}</b></span>
<span>simulation <b>{escape(provenance.simulation)}</b></span>{many}
<span><b>{number(minutes)}</b> min</span>
<span><b>{values:,}</b> values of <b>{escape(evidence.channel)}</b> compared</span></p>
</header>"""


def _where(answer: Answer, evidence: Evidence) -> str:
    parts = ["<h2>Where they differ</h2>"]
    if len(evidence.map_time_s):
        parts.append(
            f"<figure>{map_figure(answer, evidence)}<figcaption><b>Wheels and time.</b> Mean residual of each block, "
            "along the direction of rotation, in units of its standard error with the noise’s own memory counted in. "
            "Beyond ±3 is rarely noise; pale is agreement.</figcaption></figure>"
        )
    found = [*_places(answer)]
    curves = [curve for curve in (curve_of(evidence, name, wheels) for name, wheels in found) if curve is not None]
    if not curves and evidence.curves:
        curves = [evidence.curves[0]]
    parts += [_curve(curve, answer, evidence) for curve in curves[:3]]
    return "\n".join(parts)


def _places(answer: Answer) -> Iterable[tuple[str, tuple[int, ...]]]:
    """Return the covariate and wheels of everything that was found, each once."""
    named = [(effect.covariate, effect.wheels) for effect in answer.effects]
    return dict.fromkeys([*named, *((place.covariate, place.wheels) for place in answer.unexplained)])


def _curve(curve: Curve, answer: Answer, evidence: Evidence) -> str:
    where = wheels_in_words(curve.wheels, evidence.wheels)
    of = f" of {where}" if where else ""
    picture = curve_figure(curve, evidence.unit, corrected=bool(answer.effects))
    return (
        f"<figure>{picture}<figcaption><b>{_what_orders(answer)}{escape(spoken(curve.covariate))}.</b> "
        f"Mean residual{of} in bins that share the data evenly; bars are two standard errors. "
        f"{_key(answer)}</figcaption></figure>"
    )


def _what_orders(answer: Answer) -> str:
    return (
        "The most that any covariate shows, within the noise: "
        if answer.verdict == "consistent"
        else "What orders it: "
    )


def _key(answer: Answer) -> str:
    before = '<span style="color:var(--more)">●</span> calibrated simulation'
    after = ', <span style="color:var(--after)">●</span> with the effects in it'
    return f"{before}{after if answer.effects else ''}."


def _effects(answer: Answer, evidence: Evidence) -> str:
    if not answer.effects:
        return ""
    return "<h2>What was left out</h2>\n" + "\n".join(_effect(effect, evidence) for effect in answer.effects)


def _effect(effect: Effect, evidence: Evidence) -> str:
    since = "" if effect.onset_s is None else f"<span>from {number(effect.onset_s / 60)} min on</span>"
    at = which_wheels(effect.wheels, evidence.wheels)
    factor, unit_of_error = scaled(_unit_of(effect))
    before, after = factor * effect.rmse_before, factor * effect.rmse_after
    gain = 100 * (1 - after / before) if before else 0.0
    rows = "".join(
        f"<tr><td>{escape(PARAMETERS.get(name, words(name)))}</td>"
        f'<td class="n">{number(f * p.value)}</td><td class="n">{number(f * p.low)} … {number(f * p.high)}</td>'
        f"<td>{escape(unit)}</td><td>{interval_figure(p.value, p.low, p.high)}</td></tr>"
        for name, p, f, unit in ((name, p, *_read_in(name, p.unit)) for name, p in effect.parameters.items())
        if np.isfinite(p.value)
    )
    return f"""<section class="effect"><h3>{escape(capital(words(effect.name)))}</h3>
<p>{escape(capital(effect.statement))}</p>
<p class="equation">{escape(effect.equation)}</p>
<div class="chips"><span>{at}</span><span>ordered by {escape(spoken(effect.covariate))}</span>{since}
<span>held-out error {number(before)} → {number(after)} {escape(unit_of_error)} (−{gain:.1f} %)</span></div>
<table><thead><tr><th>parameter</th><th class="n">value</th><th class="n">90 % interval</th><th>unit</th><th></th></tr>
</thead><tbody>{rows}</tbody></table></section>"""


def _read_in(name: str, unit: str) -> tuple[float, str]:
    """Return factor and unit in which a parameter is read: shares in percent."""
    return (100.0, "%") if name == "relative_size" else scaled(unit)


def _unit_of(effect: Effect) -> str:
    """Return the unit that the channel's name ends in."""
    return effect.channel.rsplit("_", 1)[-1] if "_" in effect.channel else ""


def _unexplained(answer: Answer, evidence: Evidence) -> str:
    if not answer.unexplained:
        return ""
    parts = "\n".join(_open_question(place, evidence) for place in answer.unexplained)
    return (
        "<h2>What is there and has no name</h2><p>This is above the noise, and none of the known effects explains it. "
        f"It is measured and located; a name it has not earned.</p>\n{parts}"
    )


def _open_question(place: Unexplained, evidence: Evidence) -> str:
    at = which_wheels(place.wheels, evidence.wheels)
    return f"""<section class="effect open"><h3>Ordered by {escape(spoken(place.covariate))}</h3>
<div class="chips"><span>{escape(place.channel)}</span><span>{at}</span>
<span>{number(place.from_s / 60)} to {number(place.to_s / 60)} min</span>
<span>{100 * place.share_of_residual:.1f} % of the residual’s power</span></div></section>"""


def _fit(answer: Answer, evidence: Evidence) -> str:
    fit = answer.fit
    factor, unit = scaled(evidence.unit)
    before, after, floor = (
        factor * value for value in (fit.held_out_rmse_before, fit.held_out_rmse_after, fit.noise_floor_rmse)
    )
    if not answer.effects:
        errs = f"the simulation errs by {number(before)} {unit}; the noise alone is {number(floor)} {unit}"
        return f"<h2>How well it fits</h2><p>On blocks of time that did not fit it {errs}.</p>"
    reducible = before**2 - floor**2
    gained = 100 * (before**2 - after**2) / reducible if reducible > 0 else None
    closes = "" if gained is None else f" That is {min(gained, 100):.0f} % of what lay above the noise."
    return f"""<h2>How much better it fits</h2>
<figure>{fit_figure(answer, evidence.unit)}<figcaption>On data that neither chose the effects nor fitted them:
{number(before)} {unit} before, {number(after)} {unit} after; the noise alone is {number(floor)} {unit}.
{closes}</figcaption>
</figure>"""


def _indistinguishable(answer: Answer) -> str:
    if not answer.indistinguishable:
        return ""
    rows = "".join(
        f"<tr><td>{escape(listed([words(name) for name in one.effects]))}</td><td>{escape(one.experiment)}</td></tr>"
        for one in answer.indistinguishable
    )
    return (
        "<h2>What this recording cannot tell apart</h2>"
        "<p>These predict the same here, to within the noise. The drive beside each would decide.</p>"
        f"<table><thead><tr><th>effects</th><th>drive this</th></tr></thead><tbody>{rows}</tbody></table>"
    )


def _sensitivity(answer: Answer, evidence: Evidence) -> str:
    if not answer.sensitivity:
        return ""
    mean = float(np.nanmean(np.abs(evidence.measured)))
    found = {effect.name for effect in answer.effects}
    silent = [one for one in answer.sensitivity if one.name not in found]
    rows = "".join(_sensitivity_row(one.name, one.smallest_detectable, one.unit, mean) for one in silent)
    return (
        "<h2>What this recording would have shown</h2>"
        "<p>The smallest effect of each kind that would have been found nine times in ten. An effect smaller than this "
        "may be there all the same.</p>"
        '<table><thead><tr><th>effect</th><th class="n">smallest that shows</th><th></th>'
        '<th class="n">of the mean reading</th></tr></thead>'
        f"<tbody>{rows}</tbody></table>"
    )


def _sensitivity_row(name: str, size: float, unit: str, mean: float) -> str:
    spoken_name = escape(capital(words(name)))
    if not np.isfinite(size):
        return f'<tr><td>{spoken_name}</td><td class="n" colspan="3">nothing in this recording would show it</td></tr>'
    factor, shown = scaled(unit)
    share = f"{100 * size / mean:.1f} %" if mean > 0 else "–"
    return (
        f'<tr><td>{spoken_name}</td><td class="n">{number(factor * size, 2)}</td><td>{escape(shown)}</td>'
        f'<td class="n">{share}</td></tr>'
    )


def _other_curves(answer: Answer, evidence: Evidence) -> str:
    shown = {name for name, _ in _places(answer)} or {curve.covariate for curve in evidence.curves[:1]}
    first = {curve.covariate: curve for curve in reversed(evidence.curves) if len(curve.at) > 2}
    others = [c for c in evidence.curves if first.get(c.covariate) is c and c.covariate not in shown][:8]
    if not others:
        return ""
    drawn = "".join(
        '<figure style="margin:.3rem 0">'
        + curve_figure(curve, evidence.unit, corrected=bool(answer.effects), width=390, height=190)
        + "</figure>"
        for curve in others
    )
    _, unit = scaled(evidence.unit)
    return (
        f"<h2>The residual against everything else that was measured</h2><p class='soft'>Residual in {unit}; "
        f"{_key(answer)}</p><div style='display:grid;grid-template-columns:1fr 1fr;gap:.2rem 1.2rem'>{drawn}</div>"
    )


def _method(answer: Answer, provenance: Provenance) -> str:
    notes = "".join(f"<li>{escape(note)}</li>" for note in answer.notes)
    said = f"<h3>About the recording</h3><ul>{notes}</ul>" if notes else ""
    command = (
        f"<tr><td>command</td><td><code>{escape(provenance.command)}</code></td></tr>" if provenance.command else ""
    )
    return f"""<h2>How this was found</h2>
<p>The simulation is first calibrated within its stated uncertainty: what its own parameters can do is no evidence of
missing physics. Candidates are physical models with units, signs and bounds, fitted inside the simulation together with
those parameters. Noisy inputs are replaced by what they most probably were. Each candidate pays for the freedom it
has – wheels, onsets, shapes – and must gain more than the whole search finds by chance, as told by the same search
over the residual’s own blocks with their signs drawn anew. What it gains must come back on blocks, or runs, that did
not fit it.
Free curves without a name compete, and where one explains clearly more than any name does, no name is given.
Errors called held-out come from blocks of time that neither chose the effects nor fitted them.</p>
{said}
<table><tbody>
<tr><td>recording</td><td>{escape(provenance.recording)}<br><code>sha256 {provenance.recording_sha256}</code></td></tr>
<tr><td>simulation</td><td>{escape(provenance.simulation)}<br>
<code>sha256 {provenance.simulation_sha256}</code></td></tr>
{command}
<tr><td>versions</td><td>{escape(", ".join(_versions()))}</td></tr>
</tbody></table>
<footer class="note">Made by <code>regolithd mismatch</code>. Rust: more than simulated; blue: less.</footer>"""


def _versions() -> Iterable[str]:
    yield f"Python {platform.python_version()}"
    for package in ("regolithd", *COMPARED):
        try:
            yield f"{package} {metadata.version(package)}"
        except metadata.PackageNotFoundError:
            yield f"{package} from source"
