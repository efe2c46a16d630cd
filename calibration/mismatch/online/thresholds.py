"""Every number that decides in the sequential test: value, meaning, and how it was found."""

from __future__ import annotations

from dataclasses import dataclass, fields

from regolithd.calibration.mismatch.thresholds.threshold import Threshold, threshold


@dataclass(frozen=True)
class OnlineThresholds:
    """The deciding numbers of the sequential test; `table` returns them with meaning and source."""

    alarm: float = threshold(
        25.0,
        "Δχ² of the best law, wheels and onset together, above which a change is reported.",
        "simulation (`make online`): of 100 sound drives, 183 h, two pass it, and the tail of their largest statistics "
        "gives 25.2 ± 1.1 for one false report in 100 h",
    )
    interval_s: float = threshold(
        60.0,
        "Time between two decisions, and resolution of an onset [s].",
        "choice: six correlation times of a noise that is correlated for 10 s",
    )
    learning_intervals: int = threshold(
        10,
        "Intervals that the noise is estimated from before the first decision.",
        "choice: a correlation of 15 s is then known to a fifth from six wheels",
    )
    history_intervals: int = threshold(
        60,
        "Latest intervals whose residual is kept, to estimate the noise from.",
        "choice: an hour of six wheels at 10 Hz is 1.7 MB",
    )
    most_segments: int = threshold(
        32,
        "Segments of time whose sums are kept apart: onsets that are tried.",
        "choice: of a drive of three hours, onsets are then kept to a tenth of their age",
    )
    leading_share: float = threshold(
        0.5,
        "Share of `alarm` from which the leading change is taken out of the residual before it counts as noise.",
        "choice, as `noise_term_share` of the whole comparison: what is left in makes the noise seem larger",
    )
    kept_share: float = threshold(
        0.5,
        "Share of `alarm` below which a reported change is withdrawn.",
        "choice: a report that needs the threshold again each minute would come and go",
    )
    most_changes: int = threshold(6, "Changes that are reported at once.", "choice: more is another machine")
    name_lead: float = threshold(
        10.0,
        "Lead in Δχ² of another name or other wheels from which those that were told are refuted.",
        "choice: odds of 150 to 1 by the likelihoods; a name is looked at again each minute",
    )
    inexact_share: float = threshold(
        0.1,
        "Share of a law's Δχ² that all columns together, on its wheels from its onset on, may gain beyond chance; with "
        "more, what has begun has no name.",
        "choice, ten times `further_share` of the whole comparison, which fits the shapes of laws: here each has one",
    )
    together_s: float = threshold(
        300.0,
        "Time within which two changes that begin on the same wheel are one, which no single name explains [s].",
        "choice: five intervals, as far as the onset of a small change may be off",
    )
    mostly_share: float = threshold(
        0.5, "Share of an interval's readings from which a wheel is mostly not compared.", "choice: the greater part"
    )
    lasting_intervals: int = threshold(
        3,
        "Intervals one after the other in which a wheel is mostly not compared, after which it is told.",
        "choice: three minutes; a bus that drops out for less is counted, and not told",
    )
    stuck_s: float = threshold(
        20.0,
        "Time for which a reading stays exactly the same, from which it may be stuck [s].",
        "choice: columns that are recorded less often are held for seconds",
    )
    stuck_range: float = threshold(
        2.0,
        "Standard deviations of the residual by which the prediction changes meanwhile, from which it is.",
        "choice: what stays the same then differs from the prediction somewhere by one of them",
    )
    stuck_level: float = threshold(
        1e-6,
        "Probability of as many repeats, by their share at the beginning, below which it is.",
        "choice: thousands of hours of a reading of two a second that repeats by chance",
    )

    def table(self) -> tuple[Threshold, ...]:
        """Return every threshold with its value here, its meaning and how it was found."""
        return tuple(
            Threshold(f.name, float(getattr(self, f.name)), f.metadata["meaning"], f.metadata["found"])
            for f in fields(self)
        )


ONLINE_THRESHOLDS = OnlineThresholds()
"""The values in use."""
