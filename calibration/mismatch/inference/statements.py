"""The answer's sentences: about an effect (what, where, since when, how large), and a parameter beyond its prior."""

from __future__ import annotations

import re
from math import floor, isfinite, log10, sqrt
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.problem.words import in_words
from regolithd.calibration.mismatch.regression.nuisance import beyond_prior_predictive
from regolithd.calibration.mismatch.signal.normal_interval import NINETY_PERCENT_STDS
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.answer import Answer, CalibratedParameter, OtherAnswer, Parameter, Unexplained
    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape
    from regolithd.calibration.mismatch.thresholds import Thresholds


NOUNS = """
actuator antenna arm auger axis axle bank barrel battery bay bearing belt bench blade block blower boat bobbin
body bogie boom box brake branch brush bucket burner bus cabin capstan car carriage caster cell chain channel
chute column compressor conveyor crane cylinder device disc dome door drive drone drum dryer engine eye fan
finger flap flipper gate gearbox gimbal gripper hand head heater hoist hopper jaw jet joint key kiln lane
leg lift line link loop machine mast mill mixer module motor nest node nozzle oven pack paddle panel pile pillar
pipe pitch plate platform press propeller pulley pump rack rail rake ram ring robot rod roll roller rotor rover
row saw screw section segment sensor servo shaft shoe shovel side slide spindle spool spring stack stage stand
station stirrer string strut table tank thruster tool tower track train trolley truck tube turbine turret unit
valve vehicle wagon wheel winch wing zone
"""
"""What machines have several of, in English; a plural of any other word (`achse`) would be a guess."""


NO_HELP = (
    "the curve does not lower the error of readings that it was not fitted to, so that they do not confirm its shape."
)
"""What is said of an empirical curve that does not help on held-out readings."""


REFUSED = "refused, though likelier by evidence alone"
"""What another answer is that has more evidence, and failed a test of its own."""
WRONG_RATHER_THAN_RIGHT = "more probably wrong than right"
"""What an answer is that has less than half of the evidence of all."""
AS_PROBABLE = "no more probable than the next answer"
"""What an answer is that another one equals: two causes that cannot be told apart."""
AS_PROBABLE_FROM = 0.8
"""Share of the probability from which on another answer is as probable (a choice: its evidence is within 0.5)."""

EVEN = 0.5
"""Probability below which the answer is more probably wrong than right."""
LEAST_COST = 0.1
"""Share of the held-out error below which 0.0 % might be told [%]."""
LEAST_SHARE = 0.005
"""Share of the residual below which 0 % would be told."""


def doubt_of(answer: Answer) -> str:
    """Return `WRONG_RATHER_THAN_RIGHT`, or `AS_PROBABLE`, for such an answer; nothing for others."""
    probability, other = answer.probability, answer.next_best
    if probability is None or probability >= EVEN:
        return ""
    alike = other is not None and AS_PROBABLE_FROM * probability <= other.probability <= probability / AS_PROBABLE_FROM
    return AS_PROBABLE if alike else WRONG_RATHER_THAN_RIGHT


def without_name(other: OtherAnswer) -> list[str]:
    """Return what another answer says beside its names: that something is unexplained, or was stated wrongly."""
    wrong = [f"{listed(other.parameters)} stated wrongly"] if other.parameters else []
    return [*(["something unexplained"] if other.unexplained else []), *wrong]


def percent(share: float) -> str:
    """Return a share of the residual in whole percent."""
    return f"{100 * share:.0f} %" if share >= LEAST_SHARE else "less than 1 %"


def listed(items: Sequence[str]) -> str:
    """Return 'a', 'a and b', or 'a, b and c'."""
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}"


def capital(sentence: str) -> str:
    """Return the sentence with its first letter as a capital."""
    return sentence[:1].upper() + sentence[1:]


def plural(noun: str) -> str:
    """Return the plural: wheels, axes, bodies, boxes; a noun whose last word is not known in English as it is."""
    if noun.rsplit(" ", 1)[-1].lower() not in NOUNS.split():
        return noun
    if noun.endswith("is"):
        return noun[:-2] + "es"
    if re.search(r"[^aeiou]y$", noun):
        return noun[:-1] + "ies"
    return noun + ("es" if re.search(r"(s|x|z|ch|sh)$", noun) else "s")


def noun_of(column: str) -> str:
    """Return what the column that tells axes apart calls one of them: `zone_id` a zone."""
    return re.sub(r"_(id|no|nr|name|number|index)$", "", column).replace("_", " ")


def noun_before(wheels: Sequence[int | str], kind: str) -> str:
    """Return 'wheel ' or 'wheels ', to stand before names; nothing where they begin with it, as row1 and row2 do."""
    noun = noun_of(kind)
    if all(str(wheel).casefold().startswith(noun.casefold()) for wheel in wheels):
        return ""
    return f"{plural(noun) if len(wheels) > 1 else noun} "


def wheels_in_words(wheels: Sequence[int | str], of: int, kind: str = "wheel") -> str:
    """Return 'all 6 wheels', 'both axes', 'wheel 4', 'wheels 1, 3 and 5'; empty where there is one alone.

    `kind` is the column that tells them apart; one whose plural is not known gives 'each achse', 'achse 1 and 3'.
    """
    if of == 1:
        return ""
    noun = noun_of(kind)
    if len(wheels) == of:
        return f"each {noun}" if plural(noun) == noun else f"{'both' if of == 2 else f'all {of}'} {plural(noun)}"
    return noun_before(wheels, kind) + listed([str(wheel) for wheel in wheels])


def on_wheels(wheels: Sequence[int | str], of: int, kind: str = "wheel") -> str:
    """Return ', on ' and `wheels_in_words`; empty where there is one alone."""
    words = wheels_in_words(wheels, of, kind)
    return f", on {words}" if words else ""


def words_of(candidate: Candidate, shape: Shape, parameters: Mapping[str, Parameter], labels: Mapping[str, str]) -> str:
    """Return what an effect is, in the words of the machine, with the form of its law in brackets."""
    form, values = candidate.form_of(shape), {name: each.value for name, each in parameters.items()}
    return in_words(candidate.words_with(shape, values), labels) + (f" ({form})" if form else "")


def statement(
    words: str,
    wheels: Sequence[int | str],
    of: int,
    parameters: Mapping[str, Parameter],
    errors: tuple[float, float],
    kind: str,
    *,
    about_mean: bool = False,
) -> str:
    """Return one sentence about an effect.

    Parameters
    ----------
    words: what it is, as a noun phrase
    wheels: names of those that have it, of `of`; `kind` is the recording's column that tells them apart
    parameters: with `relative_size`, and `onset_s` where it has an onset
    errors: held-out root mean squares on these wheels without and with the effect
    about_mean: whether readings are measured from their mean
    """
    onset = parameters.get("onset_s")
    begins = ""
    if onset:
        value, low, high = told(onset.value, onset.low, onset.high)
        begins = f", from {value} s on (90 % sure: {low} to {high} s)"
    size = size_and_cost(parameters["relative_size"], errors, about_mean=about_mean)
    return f"{capital(words)}{on_wheels(wheels, of, kind)}{begins}: {size}."


def told(value: float, low: float, high: float) -> tuple[str, str, str]:
    """Return a value and its interval with as many decimals as the first digit of the interval's width."""
    width = high - low
    places = max(-floor(log10(width)), 0) if isfinite(width) and width > 0 else 0
    return f"{value:.{places}f}", f"{low:.{places}f}", f"{high:.{places}f}"


def size_and_cost(size: Parameter, errors: tuple[float, float], *, about_mean: bool = False) -> str:
    """Return how large an effect is over the mean reading, and what leaving it out costs.

    `about_mean`: whether readings are measured from their mean, as temperatures are.
    """
    costs = 100 * (errors[0] / errors[1] - 1) if errors[1] > 0 else 0.0
    much = f"{abs(costs):.1f} %" if abs(costs) >= LEAST_COST else f"less than {LEAST_COST} %"
    value, low, high = told(100 * size.value, 100 * size.low, 100 * size.high)
    of = "how far readings are from their mean" if about_mean else "the mean reading"
    return (
        f"{value} % of {of} (90 % sure: {low} to {high} %); "
        f"left out, it makes the held-out error there {much} {'larger' if costs >= 0 else 'smaller'}"
    )


def had_to_leave_its_prior(name: str) -> str:
    """Return how each text about a parameter beyond its prior begins."""
    return f"{name} had to leave its prior"


def beyond_prior_in_words(parameter: CalibratedParameter) -> str:
    """Return what is told of a parameter beyond its prior: where it is, how far away, and what to do."""
    begins, away = had_to_leave_its_prior(parameter.told_name), parameter.prior_stds_away
    return (
        f"{begins}: {parameter.value:.4g}{after_number(parameter.unit)} instead of "
        f"{parameter.prior:.4g} ± {float(f'{parameter.prior_std:.2g}'):g}, {away:.1f} standard deviations away. "
        "Check the stated value and its standard deviation, or look for physics that acts as this parameter does."
    )


def parameters_found(
    parameters: Sequence[CalibratedParameter], *, unexplained: bool, thresholds: Thresholds = THRESHOLDS
) -> list[CalibratedParameter]:
    """Return the parameters whose distance from their priors is a finding.

    Beside something `unexplained` a parameter takes up what of it acts as the parameter does: it is a finding there
    only where it is clearly beyond its prior.
    """
    least = thresholds.clear_prior_stds if unexplained else 0.0
    return [each for each in parameters if each.beyond_prior(thresholds) and each.prior_stds_away > least]


def notes_on_priors(
    parameters: Sequence[CalibratedParameter], *, unexplained: bool, thresholds: Thresholds = THRESHOLDS
) -> list[str]:
    """Return a note on each parameter beyond its prior: a finding, or what may stand for something unexplained."""
    found = parameters_found(parameters, unexplained=unexplained, thresholds=thresholds)
    beyond = [each for each in parameters if each.beyond_prior(thresholds)]
    strained = [] if unexplained else [each for each in parameters if _strains_its_prior(each, thresholds)]
    told = [beyond_prior_in_words(each) if each in found else _may_stand_for_it(each) for each in beyond]
    return [*told, *(_strained_in_words(each) for each in strained)]


def _strains_its_prior(parameter: CalibratedParameter, thresholds: Thresholds) -> bool:
    """Return whether a parameter within its prior is further from it than the prior lets expect of readings."""
    away, left = np.array([parameter.prior_stds_away]), np.array([parameter.variance_left])
    return not parameter.beyond_prior(thresholds) and bool(beyond_prior_predictive(away, left, thresholds)[0])


def _strained_in_words(parameter: CalibratedParameter) -> str:
    """Return where the readings alone have a parameter that its prior holds back."""
    left = parameter.variance_left
    alone = parameter.prior + (parameter.value - parameter.prior) / (1 - left)
    reach = NINETY_PERCENT_STDS * parameter.prior_std * sqrt(left / (1 - left))
    unit = after_number(parameter.unit)
    return (
        f"{parameter.told_name} is {parameter.prior_stds_away:.1f} standard deviations from its stated value, which "
        f"holds it back: by the readings alone it is {alone:.4g}{unit} (90 % sure: {alone - reach:.4g} to "
        f"{alone + reach:.4g}). A value that was stated rightly is so far from them in one recording of 370: check it."
    )


def _may_stand_for_it(parameter: CalibratedParameter) -> str:
    begins, away = beside_what_stays_unexplained(parameter.told_name), parameter.prior_stds_away
    return (
        f"{begins} {away:.1f} standard deviations from its prior. It may stand for a part of that: this is no finding."
    )


def beside_what_stays_unexplained(name: str) -> str:
    """Return how each text begins about a parameter beyond its prior that is no finding."""
    return f"Beside what stays unexplained {name} is"


def notes_beside_priors(notes: Sequence[str], moved: Sequence[CalibratedParameter]) -> list[str]:
    """Return the notes without those about parameters beyond their priors: each channel has a value of its own."""
    told = [text(each.name) for each in moved for text in (had_to_leave_its_prior, beside_what_stays_unexplained)]
    return [note for note in notes if not any(each in note for each in told)]


def after_number(unit: str) -> str:
    """Return a unit as it follows a number; nothing for a pure number."""
    return f" {unit}" if unit not in {"", "1"} else ""


def what_it_follows(place: Unexplained, covariate: str) -> str:
    """Return what the residual does over a covariate (words): it follows that, or is a constant whatever that is."""
    if place.curve is None or not is_constant(place):
        return f"follows {covariate}"
    constants = {"gain": "a constant share of the prediction", "drag": "a constant along the motion"}
    return f"is {constants.get(place.curve.coupling, 'a constant')} that hardly depends on {covariate}"


def is_constant(place: Unexplained) -> bool:
    """Return whether what is unexplained hardly varies over its covariate."""
    return place.curve is not None and place.curve.hardly_varies


def has_curve_of(place: Unexplained, before: Sequence[Unexplained]) -> bool:
    """Return whether the curve of what is unexplained was told with another range of it before."""
    return place.curve is not None and any(place.curve == other.curve for other in before)
