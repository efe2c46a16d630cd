"""Tables to download: one column for each number, text where there is text."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import pandas as pd
import pytest
from ground_messages import START_NS, received

from regolithd.daemon.ground.store.messages import MessageStore
from regolithd.daemon.ground.web.tables import KINDS, columns, csv_lines, write_parquet

if TYPE_CHECKING:
    import sqlite3
    from pathlib import Path

    from regolithd.daemon.ground.store.history import History

EVIDENCE = {
    "onset": "2026-11-22T04:00:00.000000000Z",
    "direction": "fall",
    "wheels": [1, 2, 3, 4, 5, 6],
    "torque_ratio": 0.29,
    "statistic": 11.1,
    "threshold": 10.8,
    "cohesion_fell": 0.91,
    "friction_angle_fell": None,
    "drawbar_margin_fell": 0.71,
}


def tables(history: History, kind: str, folder: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the CSV and the Parquet table of a kind."""
    text = b"".join(csv_lines(kind, history.messages("kapvik", KINDS[kind], 0, 2 * START_NS)))
    write_parquet(kind, history.messages("kapvik", KINDS[kind], 0, 2 * START_NS), folder / "table")
    return pd.read_csv(io.BytesIO(text)), pd.read_parquet(folder / "table")


def test_wheels_and_levels_have_columns_of_their_own(
    writer: sqlite3.Connection, history: History, tmp_path: Path
) -> None:
    """Six loads are six columns, and the median of the cohesion is one; a missing value is empty."""
    store = MessageStore(writer)
    store.add([received("snapshot", 1, load_N=[1.5, None, 3, 4, 5, 6]), received("posterior", 1)])
    for table in tables(history, "snapshot", tmp_path):
        assert table.loc[0, [f"load_N_{wheel}" for wheel in (1, 3, 6)]].tolist() == [1.5, 3.0, 6.0]
        assert table["load_N_2"].isna().all()
    for table in tables(history, "posterior", tmp_path):
        assert table.loc[0, "cohesion_Pa_median"] == 3350.0


def test_the_evidence_of_an_alarm_is_in_columns(writer: sqlite3.Connection, history: History, tmp_path: Path) -> None:
    """Numbers are numbers, wheels are joined, and alarms without evidence have none."""
    messages = [received("alarm/bus", 1), received("alarm/soil-change", 1, 1, name="soil-change", evidence=EVIDENCE)]
    MessageStore(writer).add(messages)
    for table in tables(history, "alarm", tmp_path):
        assert table["name"].tolist() == ["node-13", "soil-change"]
        assert table.loc[1, "evidence_torque_ratio"] == 0.29
        assert table.loc[1, "evidence_wheels"] == "1;2;3;4;5;6"
        assert table.loc[0, ["evidence_onset", "evidence_friction_angle_fell"]].isna().all()


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_the_same_columns_in_both_formats(
    kind: str, writer: sqlite3.Connection, history: History, tmp_path: Path
) -> None:
    """Also where there is no row."""
    assert writer
    text, parquet = tables(history, kind, tmp_path)
    assert list(text.columns) == list(parquet.columns) == [column.name for column in columns(kind)]
