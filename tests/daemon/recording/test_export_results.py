"""Everything that was estimated leaves as CSV, Parquet and NetCDF: for pandas and xarray, with units and UTC."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from typer.testing import CliRunner

from regolithd.calibration.parameters import SOILS
from regolithd.daemon.cli import app
from regolithd.daemon.closed_loop.simulated_drive import START_NS, record, simulate
from regolithd.daemon.closed_loop.speed_profile import SpeedProfile
from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.recording.export_results import unit_of
from regolithd.daemon.simulator.scenario import Ground, Scenario, Stretch

if TYPE_CHECKING:
    from pathlib import Path

DURATION_S = 230.0
SPEED_RAD_S = 0.3


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive from medium soil onto sand, long enough for an alarm."""
    drivetrain = Scenario().drivetrain
    configuration = Configuration.model_validate(
        {
            "nodes": {"inclinometer": 21, "ground_speed": 22},
            "drivetrain": drivetrain.model_dump() | {"no_load_current_std_A": 0.001, "gain_relative_std": 0.03},
        }
    )
    stretches = (Stretch(soil=SOILS["medium-soil"], until_m=3.4), Stretch(soil=SOILS["lete-sand"]))
    time_s = np.arange(0, DURATION_S, 0.5)
    profile = SpeedProfile(time_s, np.full(len(time_s), SPEED_RAD_S))
    drive = simulate(Scenario(ground=Ground(stretches=stretches)), configuration, profile)
    return record(drive, configuration, load_models(configuration).terrain, tmp_path_factory.mktemp("recording"))


def exported(recording: Path, to: Path, *options: str) -> str:
    """Export, and return what is printed."""
    done = CliRunner().invoke(app, ["export", str(recording), "--to", str(to), *options])
    assert done.exit_code == 0, done.output
    return done.output


def test_netcdf_opens_in_xarray_with_time_wheel_and_units(recording: Path, tmp_path: Path) -> None:
    """Times are UTC, each quantity has its unit, and posterior and alarm are there."""
    assert "460 instants" in exported(recording, tmp_path / "drive.nc")
    with xr.open_dataset(tmp_path / "drive.nc", engine="scipy") as data:
        assert dict(data.sizes) == {"time": 460, "wheel": 6}
        assert abs(data.time.to_numpy()[0] - np.datetime64(START_NS, "ns")) < np.timedelta64(1, "us")
        assert data.load_N.attrs["units"] == "N"
        assert data.posterior_cohesion_Pa_median.attrs["units"] == "Pa"
        assert data.motor_speed_rad_s.attrs["units"] == "rad s-1"
        assert float(data.slip.sel(wheel=3).mean()) == pytest.approx(0.025, abs=0.01)
        medians = data.posterior_cohesion_Pa_median.dropna("time")
        assert float(medians[-1]) < float(medians[len(medians) // 2])
        alarms = data.time.where(data.soil_change > 0, drop=True)
        assert len(alarms) >= 1
        assert (data.soil_change_torque_ratio.dropna("time") > 0).all()


def test_csv_and_parquet_have_the_same_numbers(recording: Path, tmp_path: Path) -> None:
    """One row for each instant and wheel; text and numbers of the time agree; what is missing is blank."""
    for name in ("drive.csv", "drive.parquet"):
        assert "460 instants" in exported(recording, tmp_path / name, "--everything")
    text, parquet = pd.read_csv(tmp_path / "drive.csv"), pd.read_parquet(tmp_path / "drive.parquet")
    assert list(text.columns) == list(parquet.columns)
    assert len(text) == len(parquet) == 460 * 6
    assert (pd.to_datetime(text["time"]) == parquet["time"]).all()
    assert (text["time_ms"] == parquet["time_ms"]).all()
    for name in ("cohesion_Pa", "slip", "posterior_drawbar_margin_low_90", "soil_change", "pitch_rad", "valid"):
        np.testing.assert_array_equal(text[name], parquet[name])
    assert text["motor_temperature_degC"].isna().all()


def test_without_the_option_the_table_is_that_of_the_comparison(recording: Path, tmp_path: Path) -> None:
    """Only what was measured: estimates are no inputs of a simulation."""
    assert "2760 rows" in exported(recording, tmp_path / "drive.csv")
    assert "cohesion_Pa" not in pd.read_csv(tmp_path / "drive.csv").columns


@pytest.mark.parametrize(("name", "unit"), [("posterior_slip_mean", "1"), ("wheel_torque_Nm", "N m"), ("slip", "1")])
def test_a_unit_follows_from_the_name(name: str, unit: str) -> None:
    """In the notation of UDUNITS."""
    assert unit_of(name) == unit


def test_an_empty_recording_and_an_unknown_suffix_are_errors(recording: Path, tmp_path: Path) -> None:
    """Status 1, with what to do."""
    done = CliRunner().invoke(app, ["export", str(recording), "--to", str(tmp_path / "a.xls"), "--everything"])
    assert done.exit_code == 1
    assert "Name it .csv, .parquet or .nc" in done.output
