"""What a fleet's report and corrected simulation have beside the answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.contribution import Contribution
    from regolithd.calibration.mismatch.fleet.catalogue import CatalogueRow
    from regolithd.calibration.mismatch.fleet.told.answer import FleetEffect
    from regolithd.calibration.mismatch.report.labels import Labels


@dataclass(frozen=True)
class FleetEvidence:
    """The catalogue, what things are called, and the effects as terms.

    Attributes
    ----------
    rows: what was found in which recording
    labels: names of effects, covariates and axes
    units: of each predicted channel, by its name
    wheels: of all recordings
    acting: of one rover, the effects that act in its last recording, as terms and as the answer has them
    """

    rows: tuple[CatalogueRow, ...]
    labels: Labels
    units: Mapping[str, str]
    wheels: tuple[int | str, ...]
    acting: tuple[tuple[Contribution, FleetEffect], ...] = ()
