"""What a fleet's report shows beside the answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.fleet.catalogue import CatalogueRow
    from regolithd.calibration.mismatch.report.labels import Labels


@dataclass(frozen=True)
class FleetEvidence:
    """The catalogue, and what things are called.

    Attributes
    ----------
    rows: what was found in which recording
    labels: names of effects, covariates and axes
    units: of each predicted channel, by its name
    wheels: of all recordings
    """

    rows: tuple[CatalogueRow, ...]
    labels: Labels
    units: Mapping[str, str]
    wheels: tuple[int | str, ...]
