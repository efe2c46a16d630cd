"""Which readings are compared, and where the simulation is linearised."""

from __future__ import annotations

from dataclasses import dataclass

from regolithd.calibration.mismatch.thresholds.threshold import CHOICE, threshold


@dataclass(frozen=True)
class ProblemThresholds:
    """Which readings are compared, and where the simulation is linearised."""

    # Problem
    outlier_deviations: float = threshold(
        15.0,
        "A residual further from the median than this many standard deviations (from the median absolute deviation) "
        "is an outlier and left out.",
        f"{CHOICE}: a normal residual has none beyond 6 in a million readings; effects reach a few deviations",
    )
    most_outliers_share: float = threshold(
        0.005,
        "Share of a wheel's readings of which more outliers are no faults of the recording but physics.",
        f"{CHOICE}: a bus or a sensor that drops one reading in 200 is repaired, not compared",
    )
    isolated_excursion: float = threshold(
        4.0,
        "A reading of an input or covariate is far from both of its neighbours where it lies beyond them by so many "
        "times what all but `most_outliers_share` of the readings do.",
        f"{CHOICE}: of 100 000 readings of white noise the furthest lies beyond by twice what all but 1 in 200 do",
    )
    least_known_share: float = threshold(
        0.5,
        "Share of the compared readings at which a covariate must be known; else it is left out, not the readings.",
        f"{CHOICE}: half of the recording is the most that one covariate may cost",
    )
    carried_share: float = threshold(
        0.1,
        "Difference between two predictions, with blanks of an input bridged in two ways, as a share of the residual's "
        "standard deviation, from which a reading after a blank is not compared.",
        f"{CHOICE}: it adds a hundredth to the residual's power at most",
    )
    between_share: float = threshold(
        0.3,
        "Standard deviation of a prediction between the readings of a slower input, as a share of the residual's, from "
        "which a reading is not compared.",
        f"{CHOICE}: it adds a tenth to the residual's power at most; below it, readings weigh less",
    )
    furthest_prior_stds: float = threshold(
        3.0,
        "Standard deviations of its prior beyond which a calibrated parameter is a finding of its own.",
        "standard: a normal density has one in 370 beyond three standard deviations",
    )
    clear_prior_stds: float = threshold(
        6.0,
        "The same beside something unexplained, which moves parameters that act as a part of it does.",
        f"{CHOICE}: twice as far; of 50 recordings of strangers that left something unexplained two moved a parameter "
        "beyond 3, by 3.1 and 3.2, and the true values were within one; none had a wrong parameter beside the unknown",
    )
    furthest_linearisation_stds: float = threshold(
        8.0,
        "Standard deviations of its prior beyond which no parameter is moved to linearise the simulation there, nor "
        "explains what is left.",
        f"{CHOICE}: further away a simulation may leave the range in which it can be run",
    )
    linearisation_share: float = threshold(
        0.03,
        "Difference between the simulation and its tangents, as a share of the residual's root mean square, from which "
        "the simulation is linearised anew.",
        f"{CHOICE}: it adds a thousandth to the residual's power",
    )
    fewest_readings: int = threshold(
        100, "Readings below which nothing is compared.", f"{CHOICE}: ten for each of about ten free parameters"
    )
    least_change_within: float = threshold(
        0.05,
        "Share of its root mean square by which a factor must vary on a wheel, to be told from a constant factor.",
        f"{CHOICE}: no friction or soil law is known to a few percent",
    )
    switching_share: float = threshold(
        0.05,
        "Root mean square by which the difference quotients to both sides of a parameter's value differ, as a share of "
        "their sum's, from which the simulation switches.",
        f"{CHOICE}: the seven predicted channels of five machines without a switch have 0.015 at most, a thermostat "
        "0.1 to 0.5; a law of power n has n − 1 of a half of `tangent_step`",
    )
    tangent_step: float = threshold(
        0.01,
        "Relative step of a parameter or an input for a difference quotient.",
        f"{CHOICE}: the curvature's error is of the order of the step, rounding's 1e-14 over it",
    )
