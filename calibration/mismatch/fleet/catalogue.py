"""What was found in which recording, as a table: one row for each recording, wheel and effect.

    duckdb -c "SELECT rover, wheel, effect, min(begins) FROM 'season.parquet' WHERE acts GROUP BY ALL"

answers "since when, on which wheels of which rovers".
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.fleet.told.estimates import estimates_of, parameter_alone
from regolithd.calibration.mismatch.inference.statements import parameters_found
from regolithd.calibration.mismatch.problem.words import in_units
from regolithd.calibration.mismatch.signal.normal_interval import NINETY_PERCENT_STDS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from datetime import datetime
    from pathlib import Path

    from regolithd.calibration.mismatch.answer import Verdict
    from regolithd.calibration.mismatch.fleet.told.answer import FleetAnswer, FleetEffect
    from regolithd.calibration.mismatch.fleet.told.chosen import Chosen
    from regolithd.calibration.mismatch.fleet.told.estimates import Estimate


@dataclass(frozen=True)
class CatalogueRow:
    """One effect on one wheel in one recording; a recording in which nothing was found has one row without an effect.

    Attributes
    ----------
    rover, recording, begins: which; `begins` is None where it is not known
    verdict: of this recording, as the fleet's answer has it
    wheel: its name as text
    effect, covariate, channel: what; empty where nothing was found
    found: "fleet" for an effect of the fleet, "recording" for one that this recording alone shows, "unexplained", or
        "parameter" for a parameter of the simulation that had to leave its prior
    acts: whether the effect acts in this recording, as the fleet's answer has it; of a parameter, whether the stated
        value is outside of its interval in this recording
    parameter, unit: the first coefficient of its law, or the parameter of the simulation
    value, low, high: of that in this recording alone, with a 90 % interval; None where what it shows beside leaves none
    """

    rover: str
    recording: str
    begins: datetime | None
    verdict: str
    wheel: str = ""
    effect: str = ""
    covariate: str = ""
    channel: str = ""
    found: str = ""
    acts: bool = False
    parameter: str = ""
    value: float | None = None
    low: float | None = None
    high: float | None = None
    unit: str = ""


def catalogue_rows(chosen: Chosen, answer: FleetAnswer) -> list[CatalogueRow]:
    """Return the rows of one channel, recording by recording in the order of their names' list."""
    rows = [
        *_rows_of_fleet(chosen, answer),
        *_rows_of_recordings(chosen, answer),
        *_rows_of_parameters(chosen, answer),
    ]
    with_rows = {row.recording for row in rows}
    empty = [_row(chosen, i) for i, name in enumerate(chosen.names.recordings) if name not in with_rows]
    acting = {row.recording: _verdict(rows, row.recording) for row in rows}
    told = [replace(row, verdict=acting.get(row.recording, row.verdict)) for row in (*rows, *empty)]
    return sorted(told, key=lambda row: chosen.names.recordings.index(row.recording))


def _verdict(rows: Sequence[CatalogueRow], recording: str) -> Verdict:
    """Return what the rows say of a recording."""
    acting = {row.found for row in rows if row.recording == recording and row.acts}
    return "unexplained" if "unexplained" in acting else "missing-physics" if acting else "consistent"


def _row(chosen: Chosen, recording: int, **content: object) -> CatalogueRow:
    names = chosen.names
    return CatalogueRow(
        rover=names.rovers[int(chosen.equations.rover[recording])],
        recording=names.recordings[recording],
        begins=names.begins[recording],
        verdict="consistent",
        **content,  # type: ignore[arg-type]
    )


def _rows_of_fleet(chosen: Chosen, answer: FleetAnswer) -> Iterator[CatalogueRow]:
    """Yield each effect of the fleet in each recording of its rovers, with its size in that recording alone.

    Beside what that recording shows itself, which may leave nothing to tell a size from.
    """
    for index, term in enumerate(chosen.fit.named):
        effect = answer.effects[index]
        coefficient = term.group.candidate.coefficients[0]
        beside = chosen.beside
        alone = {(i, each.wheels): each for i, each in estimates_of(beside.equations, beside.fit, index)}
        for recording, estimate in estimates_of(chosen.equations, chosen.fit, index):
            for wheel in estimate.wheels:
                yield _row(
                    chosen,
                    recording,
                    wheel=str(chosen.equations.wheels[wheel]),
                    effect=term.name,
                    covariate=effect.covariate,
                    channel=effect.channel,
                    found="fleet",
                    acts=estimate.acts,
                    parameter=coefficient.name,
                    unit=in_units(coefficient.unit, chosen.simulation.unit, chosen.labels),
                    **_within(alone.get((recording, estimate.wheels))),
                )


def _within(estimate: Estimate | None) -> dict[str, float]:
    """Return a size with its 90 % interval, where there is one."""
    if estimate is None:
        return {}
    reach = NINETY_PERCENT_STDS * estimate.std
    return {"value": estimate.value, "low": estimate.value - reach, "high": estimate.value + reach}


def _rows_of_recordings(chosen: Chosen, answer: FleetAnswer) -> Iterator[CatalogueRow]:
    """Yield what single recordings show beside the fleet's effects."""
    for effect in answer.effects[len(chosen.fit.named) :]:
        recording = chosen.names.recordings.index(effect.recordings[0])
        for wheel in effect.wheels:
            yield _row(chosen, recording, wheel=str(wheel), found="recording", acts=True, **_first(effect))
    for rest in answer.unexplained:
        told = {"covariate": rest.covariate, "channel": rest.channel}
        for recording in map(chosen.names.recordings.index, rest.recordings):
            for wheel in rest.wheels:
                yield _row(chosen, recording, wheel=str(wheel), found="unexplained", acts=True, **told)


def _rows_of_parameters(chosen: Chosen, answer: FleetAnswer) -> Iterator[CatalogueRow]:
    """Yield each parameter that had to leave its prior in each recording of its rovers, as that alone has it."""
    found = parameters_found(answer.parameters, unexplained=answer.verdict == "unexplained")
    for moved in (each for each in answer.parameters if each in found):
        alone = parameter_alone(chosen.equations, chosen.fit, chosen.found, moved.name)
        for recording, (shift, std) in enumerate(alone):
            value, reach = moved.prior + shift, NINETY_PERCENT_STDS * std
            if chosen.names.rovers[int(chosen.equations.rover[recording])] in moved.rovers:
                yield _row(
                    chosen,
                    recording,
                    channel=chosen.simulation.channel,
                    found="parameter",
                    acts=abs(shift) > reach,
                    parameter=moved.name,
                    value=value,
                    low=value - reach,
                    high=value + reach,
                    unit=moved.unit,
                )


def _first(effect: FleetEffect) -> dict[str, object]:
    name, parameter = next(iter(effect.parameters.items()))
    return {
        "effect": effect.name,
        "covariate": effect.covariate,
        "channel": effect.channel,
        "parameter": name,
        "value": parameter.value,
        "low": parameter.low,
        "high": parameter.high,
        "unit": parameter.unit,
    }


def write_catalogue(path: Path, rows: Sequence[CatalogueRow]) -> None:
    """Write the rows as a Parquet file."""
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.parquet as pq  # noqa: PLC0415

    kinds = {
        "begins": pa.timestamp("us", tz="UTC"),
        "acts": pa.bool_(),
        **dict.fromkeys(("value", "low", "high"), pa.float64()),
    }
    schema = pa.schema([(each.name, kinds.get(each.name, pa.string())) for each in fields(CatalogueRow)])
    part = path.with_name(path.name + ".part")
    pq.write_table(pa.Table.from_pylist([asdict(row) for row in rows], schema=schema), part)
    part.replace(path)
