"""A recording's results as arrays: what is said once, at an instant, and nowhere else."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from regolithd.daemon.recording.content import ESTIMATE, SNAPSHOT
from regolithd.daemon.recording.mcap_file import McapFile
from regolithd.daemon.recording.results import read_results

if TYPE_CHECKING:
    from pathlib import Path


def test_an_alarm_has_its_torque_ratio_and_the_seconds_since_its_onset(tmp_path: Path) -> None:
    """At the instant of the alarm; at all others there is none."""
    alarm = {"time_ns": 1_000_000_000, "onset_ns": 500_000_000 - 2**40, "torque_ratio": 1.25}
    with (tmp_path / "drive.mcap").open("wb") as stream:
        file = McapFile(stream, {})
        for sequence, soil_change in enumerate(({}, {"alarm": alarm}, {})):
            content = {"sequence": sequence, "time_ns": sequence * 1_000_000_000}
            for topic, more in ((SNAPSHOT, {}), (ESTIMATE, {"soil_change": soil_change})):
                file.write(topic, content["time_ns"], json.dumps(content | more).encode(), sequence)
        file.close()
    found = read_results([tmp_path / "drive.mcap"]).of_rover
    np.testing.assert_array_equal(found["soil_change"], [0, 1, 0])
    np.testing.assert_array_equal(found["soil_change_torque_ratio"], [np.nan, 1.25, np.nan])
    np.testing.assert_array_equal(found["soil_change_onset_s"], [np.nan, 0.5 + 2**40 / 1e9, np.nan])
