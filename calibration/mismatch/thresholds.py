"""Every number that decides in the mismatch engine: value, meaning, and how it was found.

`Thresholds()` holds the values in use. A problem carries one (`Problem.thresholds`), and every function of the engine
reads it from there, so that a study can compare with others: `replace(Thresholds(), further_share=0.02)`. What halving
and doubling each of them costs on blind trials is measured by

    python -m regolithd.calibration.validation.blind_trials.thresholds --seed 1 --recordings 40

Sources: *standard* is a result of statistics that is named; *choice* is a convention or a limit of cost or of interest
that no experiment decides; *development trials* is a value found on blind trials of seeds that were looked at while the
engine was written (docs/decisions/050, docs/proof.md), confirmed on seeds that were drawn afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any


def _threshold(value: float, meaning: str, found: str) -> Any:  # noqa: ANN401  # a dataclass field of the value's type
    return field(default=value, metadata={"meaning": meaning, "found": found})


TRIALS = "development trials"
CHOICE = "choice"


@dataclass(frozen=True)
class Threshold:
    """One number that decides, as data.

    Attributes
    ----------
    name: the attribute of `Thresholds`
    value: in use
    meaning: what it decides, with its unit
    found: how the value was found: a standard result, a choice, or development trials
    """

    name: str
    value: float
    meaning: str
    found: str


@dataclass(frozen=True)
class Thresholds:
    """The engine's deciding numbers; each field's meaning and source are in its metadata (`table` returns them)."""

    # Problem
    outlier_deviations: float = _threshold(
        15.0,
        "A residual further from the median than this many standard deviations (from the median absolute deviation) "
        "is an outlier and left out.",
        f"{CHOICE}: a normal residual has none beyond 6 in a million readings; effects reach a few deviations",
    )
    most_outliers_share: float = _threshold(
        0.005,
        "Share of a wheel's readings of which more outliers are no faults of the recording but physics.",
        f"{CHOICE}: a bus or a sensor that drops one reading in 200 is repaired, not compared",
    )
    least_known_share: float = _threshold(
        0.5,
        "Share of the compared readings at which a covariate must be known; else it is left out, not the readings.",
        f"{CHOICE}: half of the recording is the most that one covariate may cost",
    )
    carried_share: float = _threshold(
        0.1,
        "Difference between two predictions, with blanks of an input bridged in two ways, as a share of the residual's "
        "standard deviation, from which a reading after a blank is not compared.",
        f"{CHOICE}: it adds a hundredth to the residual's power at most",
    )
    furthest_prior_stds: float = _threshold(
        3.0,
        "Standard deviations of its prior beyond which a calibrated parameter is a finding of its own.",
        "standard: a normal density has one in 370 beyond three standard deviations",
    )
    furthest_linearisation_stds: float = _threshold(
        8.0,
        "Standard deviations of its prior beyond which no parameter is moved to linearise the simulation there, nor "
        "explains what is left.",
        f"{CHOICE}: further away a simulation may leave the range in which it can be run",
    )
    linearisation_share: float = _threshold(
        0.03,
        "Difference between the simulation and its tangents, as a share of the residual's root mean square, from which "
        "the simulation is linearised anew.",
        f"{CHOICE}: it adds a thousandth to the residual's power",
    )
    fewest_readings: int = _threshold(
        100, "Readings below which nothing is compared.", f"{CHOICE}: ten for each of about ten free parameters"
    )
    least_change_within: float = _threshold(
        0.05,
        "Share of its root mean square by which a factor must vary on a wheel, to be told from a constant factor.",
        f"{CHOICE}: no friction or soil law is known to a few percent",
    )
    tangent_step: float = _threshold(
        0.01,
        "Relative step of a parameter or an input for a difference quotient.",
        f"{CHOICE}: the curvature's error is of the order of the step, rounding's 1e-14 over it",
    )
    # Noise
    lag_significance: float = _threshold(
        2.0,
        "Standard errors below which an autocorrelation ends the sum over lags.",
        "standard: a two-sided 95 % test of one correlation; the truncation follows Geyer (1992), initial sequence",
    )
    longest_lag_share: float = _threshold(
        0.1,
        "Largest lag of the autocorrelation, as a share of the recording.",
        f"{CHOICE}: each lag is then a mean over at least nine tenths of the readings",
    )
    provisional_autocorrelation_time: float = _threshold(
        5.0,
        "Longest autocorrelation time [readings] assumed while the noise is not known yet.",
        f"{TRIALS}: a missing effect lengthens the first estimate; with that estimate the effect is not seen",
    )
    provisional_terms: int = _threshold(
        4,
        "Terms taken out of the residual before the noise is first estimated, significant or not.",
        f"{CHOICE}: twice the largest number of effects in a trial; their few coefficients hardly lower the estimate",
    )
    noise_term_share: float = _threshold(
        0.4,
        "Share of `smooth_term_entry` that a term must score to be taken out before the noise is estimated again.",
        f"{TRIALS}: what is left in makes the noise seem larger, what is taken out by chance smaller",
    )
    noise_term_columns: int = _threshold(
        12,
        "Most columns of a term that is taken out before the noise is estimated: a freer curve follows noise.",
        f"{CHOICE}: curves over covariates have at most 8, the curve over time 48",
    )
    # Blocks and folds
    block_autocorrelation_times: float = _threshold(
        10.0,
        "Length of a block of time in autocorrelation times of the noise.",
        f"{CHOICE}: the correlation between means of neighbouring blocks is then about 1/20",
    )
    most_blocks: int = _threshold(
        90,
        "Blocks of time at most, so that one is long against what the autocorrelation does not show.",
        "standard: a variance from 90 independent values is known to sqrt(2/90) = 15 %, its root to 7 %",
    )
    blocks_per_fold: int = _threshold(
        6, "Blocks that each fold should have, if the recording is long enough.", f"{CHOICE}: folds that see all states"
    )
    folds: int = _threshold(5, "Folds of the cross-validation.", "standard: five to ten (Hastie et al., 2009, 7.10)")
    # Free parameters
    own_share: float = _threshold(
        1 / 3,
        "Standard deviation of a wheel's own deviation of a parameter, as a share of the common one's.",
        f"{TRIALS}: none lets a motor that is off pass for an efficiency; as large as the common one hides ruts of 5 % "
        "(seed 4296646855041348324)",
    )
    # Smooth terms
    curve_knots: int = _threshold(8, "Knots of a smooth term over a covariate.", f"{CHOICE}: laws have one bend or two")
    time_knots: int = _threshold(
        48, "Knots of a smooth term over time.", f"{CHOICE}: spells down to a fortieth of the recording have to show"
    )
    least_variance_within: float = _threshold(
        0.2,
        "Share of a covariate's variance within wheels, below which no smooth term is made of it.",
        f"{TRIALS}: a curve over what only differs between wheels is a list of wheels",
    )
    fewest_periods: float = _threshold(
        4.0, "Periods in the recording, below which a sine over time is a slow curve.", f"{CHOICE}: two knots a period"
    )
    shortest_period: float = _threshold(
        5.0, "Shortest period of a sine over time [readings].", f"{CHOICE}: twice the Nyquist limit, and some"
    )
    # Penalties
    coefficient_penalty: float = _threshold(
        2.0, "Penalty of a coefficient, in Δχ².", "standard: Akaike's information criterion"
    )
    single_wheel_penalty: float = _threshold(
        6.0,
        "Penalty, in Δχ², of one wheel (or some) for an effect that all wheels may have.",
        f"{CHOICE}: prior odds of about 20 to 1 (2 ln 20) that what all wheels are built with is on all",
    )
    unlikely_penalty: float = _threshold(
        9.2,
        "Penalty, in Δχ², of an effect that the simulation calls unlikely on its machine.",
        f"{CHOICE}: prior odds of one in a hundred (2 ln 100)",
    )
    own_channel_share: float = _threshold(
        0.5,
        "Share of a fault's Δχ² in its own channel that is credited to it in the predicted one.",
        f"{TRIALS}: half, since the own channel's reference is only as good as pitch and roll",
    )
    largest_own_channel_credit: float = _threshold(
        300.0, "Largest such credit, in Δχ².", f"{TRIALS}: a large drift must show in the predicted channel too"
    )
    own_channel_visible: float = _threshold(
        25.0, "Δχ² in its own channel below which a fault is not there.", f"{CHOICE}: five standard deviations"
    )
    # Regression
    least_tolerance: float = _threshold(
        1e-3,
        "Tolerance (1 / variance inflation factor) below which a column counts as a combination of the others.",
        "standard: the usual limit of stepwise regression (SPSS, SAS) is 1e-3 to 1e-4; sums are in single precision",
    )
    active_share: float = _threshold(
        0.4,
        "An effect's size counts as at least this share of its root mean square while it acts.",
        f"{TRIALS}: what acts a tenth of the time is not missed for its small mean",
    )
    # Entry into the set of named effects
    false_name_rate: float = _threshold(
        0.005, "Rate of names given by chance where nothing is missing.", f"{CHOICE}: half of the contract's 1 %"
    )
    sign_flip_draws: int = _threshold(
        600, "Draws of the sign-flip test.", f"{CHOICE}: three draws are beyond the quantile of 0.5 %; a second of time"
    )
    sign_flip_margin: float = _threshold(
        1.0, "Added to the quantile of the sign-flip test, in Δχ².", f"{CHOICE}: about its own standard error"
    )
    least_entry: float = _threshold(
        5.0, "Lowest entry threshold, in Δχ² less penalty.", f"{TRIALS}: 600 draws do not know their own tail"
    )
    largest_entry: float = _threshold(
        12.0, "Highest entry threshold, in Δχ² less penalty.", f"{TRIALS}: structure left in draws raises the quantile"
    )
    further_term_entry: float = _threshold(
        2.0,
        "Added to the entry threshold of a further effect beside one that was chosen already.",
        f"{TRIALS}: the further one is chosen beside a choice",
    )
    further_share: float = _threshold(
        0.01,
        "Share of the others' Δχ² that a further effect must gain: no law is exact to the last percent.",
        f"{TRIALS}: laws of the generator differ from the candidates' by percents",
    )
    remaining_share: float = _threshold(
        0.1, "Or the share of what the others leave that it must take.", f"{TRIALS}: for a small effect beside a large"
    )
    beside_smooth_share: float = _threshold(
        0.1,
        "Share of a smooth term's Δχ² that an effect beside it must gain: less may have leaked from it.",
        f"{TRIALS}: what has no law leaks into every law",
    )
    smallest_effect: float = _threshold(
        0.02,
        "Smallest active root mean square of a named effect, as a share of the channel's mean magnitude.",
        f"{CHOICE}: less is no finding; effects in trials start at 5 %",
    )
    own_channel_ratio_low: float = _threshold(
        0.4, "Least ratio of a fault's size in the predicted channel to that in its own.", f"{TRIALS}: drift of cells"
    )
    own_channel_ratio_high: float = _threshold(
        2.5, "Largest such ratio.", "the reciprocal of the least, so that neither channel is preferred"
    )
    # Breadth of the search
    polished_singles: int = _threshold(5, "Single effects whose shape is optimised.", f"{CHOICE}: computing time")
    pair_breadth: int = _threshold(4, "Second effects tried beside each first.", f"{CHOICE}: computing time")
    polished_pairs: int = _threshold(4, "Pairs whose shapes are optimised.", f"{CHOICE}: computing time")
    triple_breadth: int = _threshold(
        2, "Pairs to which a third effect is added, and third effects for each.", f"{CHOICE}: computing time"
    )
    # Shape optimisation
    onset_reach: float = _threshold(
        0.05, "Half width of the search for an onset, as a share of the recording.", "the grid's spacing of 4 %"
    )
    shape_reach: float = _threshold(
        0.35, "Half width of the search for a shape parameter, relative to its value.", "the grids' ratios of 1.5 to 2"
    )
    shape_reach_floor: float = _threshold(
        0.2, "Share of its range that counts as a shape parameter's least value there.", f"{CHOICE}: values near 0"
    )
    self_consistency_steps: int = _threshold(
        4, "Most steps towards a shape that agrees with its coefficients.", f"{CHOICE}: two are usual"
    )
    # Cross-validation
    transferred_share: float = _threshold(
        0.5,
        "Least share of an effect's Δχ² that must be gained on folds that did not fit it.",
        f"{CHOICE}: of a stationary effect all but the coefficients' cost comes back, of an occasion nothing",
    )
    coefficient_cost: float = _threshold(
        2.0, "Expected loss of a fitted coefficient on new data, in Δχ².", "standard: the optimism of least squares"
    )
    # Smooth terms against names
    smooth_term_entry: float = _threshold(
        20.0,
        "Score above which a smooth term is significant, in Δχ² less penalty.",
        f"{TRIALS}: by chance at most 6.8 in 47 sound recordings and once 17.1 beside a named effect; the weakest "
        "concealed one of 25 scored 31 (seeds 98309134, 127741224)",
    )
    smooth_term_power: float = _threshold(
        0.01, "Share of the residual's power on its wheels below which a smooth term is ignored.", f"{CHOICE}"
    )
    form_misfit: float = _threshold(
        0.12,
        "Share of Δχ² that a smooth term may add to an effect's law, which is then still taken as the right law.",
        f"{TRIALS}: laws of the generator differ from the candidates'",
    )
    transient_level: float = _threshold(
        1e-3,
        "Level of the test that a change comes and goes, by a curve over time beside it.",
        f"{CHOICE}: one test for each change that is named",
    )
    # Intervals
    discrepancy_std: float = _threshold(
        0.15,
        "Standard deviation of the share by which a law is wrong, at each knot of its covariate and on each wheel.",
        f"{TRIALS}: with 0.1, 87 of 100 intervals held; form after Kennedy and O'Hagan (2001)",
    )
    discrepancy_knots: int = _threshold(6, "Knots of that discrepancy.", f"{CHOICE}: fewer than of a smooth term")
    interval_draws: int = _threshold(4000, "Draws of the coefficients for intervals.", "choice: 1 % of their width")
    parameter_draws: int = _threshold(1000, "Of these, draws for the parameters.", "choice: 2 % of their width")
    slope_step: float = _threshold(
        1e-3, "Step of a shape parameter for its slope, as a share of its range.", f"{CHOICE}: a difference quotient"
    )
    least_likelihood_ratio: float = _threshold(
        0.02, "Likelihood ratio to the best shape, below which another kind of shape is not counted.", f"{CHOICE}"
    )
    onset_fall: float = _threshold(
        5.94,
        "Fall of Δχ² within the 90 % interval of an onset.",
        "standard: the likelihood of a change point is a random walk to both sides, whose supremum is exponential: "
        "(1 − exp(−fall / 2))² = 0.9 (Hinkley, 1970)",
    )
    # Identifiability
    confusion_rate: float = _threshold(
        0.05, "Rate of a wrong choice between two effects, above which they are not told apart.", "standard: 5 % level"
    )
    told_apart: float = _threshold(
        10.8,
        "Δχ² apart, below which the wrong one of two leads more than one time in twenty.",
        "standard: (2 × 1.645)², the lead being normal about μ with variance 4 μ",
    )
    effect_to_tell_apart: float = _threshold(
        0.15, "Size at which two effects should be told apart, over the mean magnitude.", f"{CHOICE}: usual in trials"
    )
    largest_plausible_factor: float = _threshold(
        2.0, "How many times that size is implausible to have been overlooked.", f"{CHOICE}"
    )
    most_imitating_columns: int = _threshold(
        2, "Columns above which an effect is not asked whether others imitate it.", f"{CHOICE}: ripples are unlike all"
    )
    taken_over_share: float = _threshold(
        0.2, "Share of an effect's size that another takes from it, if it stands for a part of it.", f"{TRIALS}"
    )
    equal_gain: float = _threshold(
        0.5, "Difference of Δχ² below which two sets explain the recording equally well.", f"{CHOICE}: e^0.25 in odds"
    )
    lead_margin: float = _threshold(
        4.0,
        "Lead in score that the choice among shapes and inexact laws give by chance.",
        f"{TRIALS}: of two candidates for one effect, the true one must stay in the set",
    )
    rivals_tried: int = _threshold(8, "Other effects tried in the place of each.", f"{CHOICE}: computing time")
    additions_tried: int = _threshold(3, "Other effects tried beside each.", f"{CHOICE}: computing time")
    # Probability of the answer
    evidence_scale: float = _threshold(
        2.0,
        "Margin of evidence, in Δχ², by which an answer is e times as probable as another.",
        "standard: Δχ² is twice a log likelihood ratio; it is also the best of 1 to 14 on 123 trials of seed 61180339",
    )
    highest_probability: float = _threshold(
        0.98,
        "Probability, for each channel, of an answer that no alternative comes near to.",
        f"{TRIALS}: of 75 answers with the highest margins, 73 had the right names (seed 61180339)",
    )
    # Sensitivity and experiments
    detection_quantile: float = _threshold(
        1.2816, "Normal quantile of the probability with which an effect is to be found.", "standard: of 0.9"
    )
    effect_of_experiment: float = _threshold(
        0.05,
        "Smallest effect that a proposed experiment must show, over the mean magnitude.",
        f"{CHOICE}: as in trials",
    )
    shortest_experiment: float = _threshold(
        1 / 3,
        "Shortest experiment that is proposed, as a share of the recording.",
        f"{CHOICE}: the machine has to settle in each of the states that it varies",
    )
    longest_experiment: float = _threshold(
        4.0,
        "Longest experiment that is proposed, as a multiple of the recording.",
        f"{CHOICE}: what was recorded for half an hour can be recorded for two",
    )
    experiment_tolerance: float = _threshold(
        0.1,
        "Tolerance expected of an effect in an experiment that varies its covariate.",
        f"{TRIALS}: of friction beside gain, cohesion and friction angle when speed and direction vary",
    )

    def table(self) -> tuple[Threshold, ...]:
        """Return every threshold with its value here, its meaning and how it was found."""
        return tuple(
            Threshold(f.name, float(getattr(self, f.name)), f.metadata["meaning"], f.metadata["found"])
            for f in fields(self)
        )


THRESHOLDS = Thresholds()
"""The values in use."""
