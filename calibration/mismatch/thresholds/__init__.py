"""Every number that decides in the mismatch engine: value, meaning, and how it was found, by what it decides.

`Thresholds()` holds the values in use. A problem carries one (`Problem.thresholds`), and every function of the engine
reads it from there, so that a study can compare with others: `replace(Thresholds(), further_share=0.02)`. What halving
and doubling each of them costs on blind trials is measured by

    python -m regolithd.calibration.validation.blind_trials.thresholds --seed 1 --recordings 40

Sources: *standard* is a result of statistics that is named; *choice* is a convention or a limit of cost or of interest
that no experiment decides; *development trials* is a value found on blind trials of seeds that were looked at while the
engine was written (docs/decisions/050, docs/results/blind-trials.md), confirmed on seeds that were drawn afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

from regolithd.calibration.mismatch.thresholds.inference import InferenceThresholds
from regolithd.calibration.mismatch.thresholds.noise import NoiseThresholds
from regolithd.calibration.mismatch.thresholds.problem import ProblemThresholds
from regolithd.calibration.mismatch.thresholds.selection import SelectionThresholds
from regolithd.calibration.mismatch.thresholds.threshold import Threshold as Threshold  # for its users


@dataclass(frozen=True)
class Thresholds(InferenceThresholds, SelectionThresholds, NoiseThresholds, ProblemThresholds):
    """The engine's deciding numbers; each field's meaning and source are in its metadata (`table` returns them).

    The fields of the last base come first.
    """

    def table(self) -> tuple[Threshold, ...]:
        """Return every threshold with its value here, its meaning and how it was found."""
        return tuple(
            Threshold(f.name, float(getattr(self, f.name)), f.metadata["meaning"], f.metadata["found"])
            for f in fields(self)
        )


THRESHOLDS = Thresholds()
"""The values in use."""
