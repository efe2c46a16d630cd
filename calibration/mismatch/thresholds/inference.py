"""What is told of a decision: intervals, what cannot be told apart, probability, experiments."""

from __future__ import annotations

from dataclasses import dataclass

from regolithd.calibration.mismatch.thresholds.threshold import CHOICE, TRIALS, threshold


@dataclass(frozen=True)
class InferenceThresholds:
    """What is told of a decision: intervals, what cannot be told apart, probability, experiments."""

    # Intervals
    discrepancy_std: float = threshold(
        0.15,
        "Standard deviation of the share by which a law is wrong, at each knot of its covariate and on each wheel.",
        f"{TRIALS}: with 0.1, 87 of 100 intervals held; form after Kennedy and O'Hagan (2001)",
    )
    discrepancy_knots: int = threshold(6, "Knots of that discrepancy.", f"{CHOICE}: fewer than of a smooth term")
    interval_draws: int = threshold(4000, "Draws of the coefficients for intervals.", "choice: 1 % of their width")
    parameter_draws: int = threshold(1000, "Of these, draws for the parameters.", "choice: 2 % of their width")
    slope_step: float = threshold(
        1e-3, "Step of a shape parameter for its slope, as a share of its range.", f"{CHOICE}: a difference quotient"
    )
    least_likelihood_ratio: float = threshold(
        0.02, "Likelihood ratio to the best shape, below which another kind of shape is not counted.", f"{CHOICE}"
    )
    onset_fall: float = threshold(
        5.94,
        "Fall of Δχ² within the 90 % interval of an onset.",
        "standard: the likelihood of a change point is a random walk to both sides, whose supremum is exponential: "
        "(1 − exp(−fall / 2))² = 0.9 (Hinkley, 1970)",
    )
    size_discrepancy_std: float = threshold(
        0.025,
        "Standard deviation of the share by which an effect's size is off as a whole: a derivative of a sampled speed, "
        "a reading interpolated at a delay, errors of the inputs; the discrepancies at knots cancel in the size.",
        f"{TRIALS}: of 442 intervals 84 % held without it; with 0.02 to 0.03, 89 to 91 % would have (seeds 608151401, "
        "127741224, 538660261)",
    )
    # What comes and goes
    switching_entry: float = threshold(
        22.0,
        "Gain (twice the log likelihood ratio) by which a mean that switches has to be likelier than noise.",
        f"{TRIALS}: of 400 courses of ten kinds of noise at most 9, of 54 blind recordings and 28 of strangers without "
        "spells at most 21; seven spells of 1 to 1.5 times the noise, on one of six wheels, gain 19 and 56 (medians)",
    )
    most_skewness_deviates: float = threshold(
        5.0,
        "Standard normal deviate of the skewness of running means beyond which a residual is skewed.",
        f"{TRIALS}: of 2000 courses of ten kinds of noise 9 are beyond 4 and 1 is beyond 5, as 2 recordings without "
        "spells are beyond 3.8 (of six wheels, by a misfit of 1 % of the power, 4.8); two large spells of 15 to 40 "
        "readings reach 5.3 and more, and many small ones have two levels",
    )
    least_skewness: float = threshold(
        0.8,
        "Skewness below which it is no finding: laws and sensors are not quite linear.",
        f"{TRIALS}: in 94 recordings of twelve machines with nothing, or what was found, left out, it was at most 0.6 "
        "where it was beyond 2.5 standard errors; with drag in spells, a sticking valve or slipstream 0.9 to 1.7",
    )
    most_jump_deviates: float = threshold(
        7.0,
        "Standard deviations of the differences between the medians before and after an instant, beyond which a level "
        "jumps.",
        f"{TRIALS}: of 1080 courses of Gaussian noise of 600 to 10 000 readings, with memories of 3 to 300 of them, "
        "the largest of all differences was 6.2; three spells of a stranger's kettle, six times the noise, have 8.6",
    )
    noise_size_readings: int = threshold(
        32,
        "Differences from one reading to the next that show how large the noise is about an instant.",
        f"{CHOICE}: their root mean square is then known to about 15 %, and noise grows and fades over more readings",
    )
    fewest_blocks: int = threshold(
        40,
        "Readings below which it is not asked for what comes and goes.",
        f"{CHOICE}: ten spells of the shortest duration that is tried, with as much time between them",
    )
    fewest_means: int = threshold(
        40,
        "Running means that do not overlap, below which their skewness is not asked for.",
        f"{CHOICE}: the skewness of 40 normal values is known to sqrt(6/40) = 0.4",
    )
    # Identifiability
    confusion_rate: float = threshold(
        0.05, "Rate of a wrong choice between two effects, above which they are not told apart.", "standard: 5 % level"
    )
    told_apart: float = threshold(
        10.8,
        "Δχ² apart, below which the wrong one of two leads more than one time in twenty.",
        "standard: (2 × 1.645)², the lead being normal about μ with variance 4 μ",
    )
    effect_to_tell_apart: float = threshold(
        0.15, "Size at which two effects should be told apart, over the mean magnitude.", f"{CHOICE}: usual in trials"
    )
    largest_plausible_factor: float = threshold(
        2.0, "How many times that size is implausible to have been overlooked.", f"{CHOICE}"
    )
    most_imitating_columns: int = threshold(
        2, "Columns above which an effect is not asked whether others imitate it.", f"{CHOICE}: ripples are unlike all"
    )
    taken_over_share: float = threshold(
        0.2, "Share of an effect's size that another takes from it, if it stands for a part of it.", f"{TRIALS}"
    )
    equal_gain: float = threshold(
        0.5, "Difference of Δχ² below which two sets explain the recording equally well.", f"{CHOICE}: e^0.25 in odds"
    )
    lead_margin: float = threshold(
        4.0,
        "Lead in score that the choice among shapes and inexact laws give by chance.",
        f"{TRIALS}: of two candidates for one effect, the true one must stay in the set",
    )
    rivals_tried: int = threshold(8, "Other effects tried in the place of each.", f"{CHOICE}: computing time")
    additions_tried: int = threshold(3, "Other effects tried beside each.", f"{CHOICE}: computing time")
    # Probability of the answer
    evidence_scale: float = threshold(
        2.0,
        "Margin of evidence, in Δχ², by which an answer is e times as probable as another.",
        "standard: Δχ² is twice a log likelihood ratio; it is also the best of 1 to 14 on 123 trials of seed 61180339",
    )
    highest_probability: float = threshold(
        0.98,
        "Probability, for each channel, of an answer that no alternative comes near to.",
        f"{TRIALS}: of 75 answers with the highest margins, 73 had the right names (seed 61180339)",
    )
    highest_season_probability: float = threshold(
        0.8,
        "Probability of an answer of many recordings that no alternative comes near to.",
        "measured: of 270 cases in five strangers' trials of seasons 217 were right on the engine after each "
        "(docs/results/strangers.md)",
    )
    # Sensitivity and experiments
    detection_quantile: float = threshold(
        1.2816, "Normal quantile of the probability with which an effect is to be found.", "standard: of 0.9"
    )
    effect_of_experiment: float = threshold(
        0.05,
        "Smallest effect that a proposed experiment must show, over the mean magnitude.",
        f"{CHOICE}: as in trials",
    )
    shortest_experiment: float = threshold(
        1 / 3,
        "Shortest experiment that is proposed, as a share of the recording.",
        f"{CHOICE}: the machine has to settle in each of the states that it varies",
    )
    longest_experiment: float = threshold(
        4.0,
        "Longest experiment that is proposed, as a multiple of the recording.",
        f"{CHOICE}: what was recorded for half an hour can be recorded for two",
    )
    experiment_tolerance: float = threshold(
        0.1,
        "Tolerance expected of an effect in an experiment that varies its covariate.",
        f"{TRIALS}: of friction beside gain, cohesion and friction angle when speed and direction vary",
    )
