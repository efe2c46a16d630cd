"""The closed-loop study's parts: cases, speed profile, frames, estimates and their errors, summary and picture."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from golden import assert_golden, description
from matplotlib.figure import Figure

from regolithd.calibration.parameters import SOILS, Drivetrain
from regolithd.daemon.closed_loop import case as case_module
from regolithd.daemon.closed_loop import picture, run, summary
from regolithd.daemon.closed_loop.case import Case, cases, first_scenario, rover_toml, second_scenario, sim_toml
from regolithd.daemon.closed_loop.run import DriveLengths, LoopResult, run_case
from regolithd.daemon.closed_loop.simulated_drive import START_NS, estimates, record, simulate
from regolithd.daemon.closed_loop.soil_estimates import SoilEstimates, figures, soil_estimates, with_posterior_enabled
from regolithd.daemon.closed_loop.speed_profile import SpeedProfile, traverse
from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.config.reader import read_configuration
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.simulator.pdo_frames import FRAME_NS, frames
from regolithd.drivers.devices.decoding.decoder import Decoder
from regolithd.drivers.devices.decoding.signals import Reading
from regolithd.drivers.virtual.plant import Measurement

if TYPE_CHECKING:
    from regolithd.daemon.pipeline.terrain_network import TerrainNetwork

GOLDEN = Path(__file__).with_name("golden")
COULOMB, VISCOUS, NOTHING = cases(5)


@pytest.fixture
def body(tmp_path: Path) -> Configuration:
    """The configuration that a case starts from."""
    path = tmp_path / "rover.toml"
    path.write_text(rover_toml(VISCOUS))
    return read_configuration(path)


@pytest.fixture
def network(body: Configuration) -> TerrainNetwork:
    """The paper's network."""
    return load_models(body).terrain


@pytest.mark.parametrize("seed", range(20))
def test_the_hidden_effect_is_drawn_around_its_nominal_size(seed: int) -> None:
    """Constant friction is 37 mA, viscous friction 40 µA s/rad, each within 15 %; the third case hides nothing."""
    coulomb, viscous, nothing = cases(seed)
    assert coulomb.hidden["no_load_current_A"] == pytest.approx(0.037, rel=0.15)
    assert viscous.hidden["viscous_current_A_s_per_rad"] == pytest.approx(4e-5, rel=0.15)
    assert nothing.hidden == {}
    assert (coulomb.names, viscous.names, nothing.names) == (("coulomb-friction",), ("viscous-friction",), ())
    assert coulomb.known == {}
    assert viscous.known == nothing.known == {"no_load_current_A": 0.037, "no_load_current_std_A": 0.001}


def test_cases_depend_on_the_seed_alone() -> None:
    """The same seed gives the same sizes and scenario, another one others; sizes spread over the whole range."""
    assert cases(5) == (COULOMB, VISCOUS, NOTHING)
    sizes = [cases(seed)[0].hidden["no_load_current_A"] / 0.037 for seed in range(60)]
    assert min(sizes) < 0.9
    assert max(sizes) > 1.1
    assert first_scenario(COULOMB, 5) == first_scenario(COULOMB, 5)
    assert first_scenario(COULOMB, 5) != first_scenario(COULOMB, 6)


def test_the_first_drive_is_on_the_known_soil_with_the_hidden_effect() -> None:
    """Gain and soil are drawn within three per cent (twice at most); grade resistance is off; slopes are of 4°."""
    stated, moved = SOILS["sandy-loam"], []
    for seed in range(30):
        scenario = first_scenario(VISCOUS, seed)
        (stretch,) = scenario.ground.stretches
        moved.append(
            [
                stretch.soil.cohesion_Pa / stated.cohesion_Pa,
                stretch.soil.friction_angle_deg / stated.friction_angle_deg,
                scenario.drivetrain.gain_factor[0],
            ]
        )
        assert scenario.seed == seed
        assert (scenario.ground.wave_deg, scenario.ground.wave_length_m) == (4.0, 4.0)
        assert scenario.hidden.grade_resistance == 0.0
        assert scenario.drivetrain.no_load_current_A == (0.037,) * 6
        assert scenario.drivetrain.viscous_current_A_s_per_rad[0] == VISCOUS.hidden["viscous_current_A_s_per_rad"]
    assert np.abs(np.array(moved) - 1).max() <= 0.06 + 1e-9
    assert np.std(moved, axis=0) == pytest.approx(0.03, rel=0.4)
    assert np.mean(moved, axis=0) == pytest.approx(1.0, abs=0.015)
    assert first_scenario(COULOMB, 5).drivetrain.no_load_current_A[0] == COULOMB.hidden["no_load_current_A"]


def test_the_second_drive_is_on_three_other_soils() -> None:
    """Each of the first two is 4.5 m long; rover and hidden effect are the same, the ground's seed is the next."""
    first = first_scenario(COULOMB, 5)
    second = second_scenario(first)
    assert [stretch.until_m for stretch in second.ground.stretches] == [4.5, 9.0, None]
    assert [stretch.soil for stretch in second.ground.stretches] == [
        SOILS[name] for name in ("lete-sand", "clayey-soil", "medium-soil")
    ]
    assert (second.seed, second.ground.wave_deg, second.ground.wave_length_m) == (6, 1.5, 4.0)
    assert second.drivetrain == first.drivetrain
    assert [stretch.until_m for stretch in second_scenario(first, 2.0).ground.stretches] == [2.0, 4.0, None]


def test_the_files_of_a_case_state_what_is_known_and_nothing_else() -> None:
    """Neither rover.toml nor SIM.toml has the hidden effect; both state the standard deviations."""
    rover, simulation = tomllib.loads(rover_toml(VISCOUS)), tomllib.loads(sim_toml(VISCOUS))
    known = {"gain_relative_std": 0.03, "no_load_current_A": 0.037, "no_load_current_std_A": 0.001}
    assert rover == {"nodes": {"inclinometer": 21, "ground_speed": 22}, "drivetrain": known}
    assert simulation == {
        "simulation": {"model": "rover-wheel"},
        "drivetrain": known,
        "soil": SOILS["sandy-loam"].model_dump() | {"cohesion_relative_std": 0.03, "friction_angle_relative_std": 0.03},
        "sensors": {
            "load_relative_std": 0.07,
            "ground_speed_relative_std": 0.002,
            "pitch_std_rad": 0.001,
            "roll_std_rad": 0.001,
            "yaw_rate_std_rad_s": 0.0003,
        },
    }
    assert tomllib.loads(rover_toml(COULOMB))["drivetrain"] == {"gain_relative_std": 0.03}


def test_the_frames_of_a_sync_hold_the_measurement(body: Configuration) -> None:
    """SYNC first, then every TPDO in the order of its COB-ID 130 µs apart; decoded, it is the measurement."""
    wheel = np.arange(6.0)
    read = Measurement(
        motor_current_A=0.040 + 0.002 * wheel,
        load_N=50.0 + wheel,
        motor_temperature_degC=20.0 + wheel,
        pitch_rad=0.02,
        roll_rad=-0.03,
        yaw_rate_rad_s=0.01,
        ground_speed_m_s=0.0213,
        bus_voltage_V=24.0,
    )
    nodes = body.described()
    sent = list(frames(nodes, 1_000, 400.0 + wheel, read))
    assert (sent[0].can_id, sent[0].data, sent[0].time_ns, sent[0].sent) == (0x080, b"", 1_000, True)
    assert [frame.can_id for frame in sent[1:]] == sorted(frame.can_id for frame in sent[1:])
    assert [frame.time_ns for frame in sent[1:]] == [1_000 + 130_000 * place for place in range(1, len(sent))]
    assert FRAME_NS == 130_000
    decoder = Decoder(nodes)
    found = {}
    for frame in sent[1:]:
        signal = decoder.decode(frame)
        assert isinstance(signal, Reading)
        found |= {(signal.node_id, quantity.name): value for quantity, value in signal.values}
    for k in range(6):
        assert found[1 + k, "motor_current_A"] == pytest.approx(0.040 + 0.002 * k)
        assert found[1 + k, "motor_speed_rad_s"] == pytest.approx(400.0 + k, abs=0.06)
        assert found[1 + k, "statusword"] == 0x1237
        assert found[11 + k, "load_N"] == pytest.approx(50.0 + k)
    assert found[21, "pitch_rad"] == pytest.approx(0.02, abs=1e-4)
    assert found[21, "roll_rad"] == pytest.approx(-0.03, abs=1e-4)
    assert found[21, "yaw_rate_rad_s"] == pytest.approx(0.01, abs=1e-4)
    assert found[22, "ground_speed_m_s"] == pytest.approx(0.0213, abs=1e-5)


def test_a_simulated_drive_gives_an_estimate_and_a_truth_for_each_sync(
    body: Configuration, network: TerrainNetwork, tmp_path: Path
) -> None:
    """Times follow the profile from 11 June 2013; the recording is a file in the folder."""
    profile = traverse(1, 30.0, body.sync.rate_Hz)
    drive = simulate(first_scenario(VISCOUS, 5), body, profile)
    assert len(drive.frames) == len(drive.truth) == len(profile.time_s)
    assert [batch[0].time_ns for batch in drive.frames[:3]] == [START_NS, START_NS + 500_000_000, START_NS + 10**9]
    made = list(estimates(drive, body, network))
    assert len(made) == len(drive.frames)
    speed = made[20].snapshot.motor_speed_rad_s
    assert speed == pytest.approx(profile.wheel_speed_rad_s[20] * body.drivetrain.ratio, rel=0.01)
    recording = record(drive, body, network, tmp_path / "recording")
    assert recording.suffix == ".mcap"
    assert recording.stat().st_size > 10_000
    assert recording.parent == tmp_path / "recording"
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        record(drive, body, network, tmp_path / "file")


def test_soil_estimates_are_in_kpa_and_degrees_beside_the_truth(body: Configuration, network: TerrainNetwork) -> None:
    """NaN before the first posterior; the true values are those of the soil; the interval has the mean inside."""
    profile = SpeedProfile(np.arange(80) / 2.0, np.r_[np.zeros(4), np.full(76, 0.3)])
    soil = soil_estimates(simulate(first_scenario(VISCOUS, 5), body, profile), body, network)
    true = first_scenario(VISCOUS, 5).ground.stretches[0].soil
    assert soil.time_s[:3].tolist() == [0.0, 0.5, 1.0]
    assert soil.truth[-1] == pytest.approx([true.cohesion_Pa / 1e3, true.friction_angle_deg])
    assert np.isnan(soil.mean[0]).all()
    assert np.isnan(soil.network[0]).all()
    at = soil.settled & np.isfinite(soil.mean).all(axis=1)
    assert at.any()
    assert (soil.low[at] < soil.mean[at]).all()
    assert (soil.mean[at] < soil.high[at]).all()
    cohesion_kPa, angle_deg = soil.mean[at].mean(axis=0)
    assert (0.5 < cohesion_kPa < 15, 10 < angle_deg < 45) == (True, True)
    assert 0.1 < soil.network[at][:, 0].mean() < 20
    assert 5 < soil.network[at][:, 1].mean() < 60
    window = round(body.posterior.window_s * body.sync.rate_Hz) + 1
    assert np.flatnonzero(soil.settled)[0] == window - 1
    assert soil.settled[window - 1 :].all()


def test_the_posterior_is_computed_without_a_calibrated_no_load_current() -> None:
    """A current of 1 nA enables it; a configuration that has one is left as it is."""
    assert with_posterior_enabled(Configuration()).drivetrain.no_load_current_A == (1e-9,) * 6
    calibrated = Configuration.model_validate({"drivetrain": {"no_load_current_A": 0.037}})
    assert with_posterior_enabled(calibrated) is calibrated


def made_up(scale: float) -> SoilEstimates:
    """Return estimates with errors of known size: the posterior's is `scale`, alternating around an offset."""
    count, sign = 40, np.where(np.arange(40) % 2, 1.0, -1.0)[:, None]
    soils = [SOILS[name] for name in case_module.OTHER_SOILS for _ in range(count // 3 + 1)][:count]
    truth = np.array([[soil.cohesion_Pa / 1e3, soil.friction_angle_deg] for soil in soils])
    mean = truth + scale * (0.5 + sign) * np.array([0.2, 1.0])
    settled = np.arange(count) >= 10
    mean[:5] = np.nan
    network = truth - 1.0
    network[20] = np.nan
    return SoilEstimates(np.arange(count) * 0.5, truth, settled, mean, mean - 1.2 * scale, mean + 1.2 * scale, network)


def test_errors_and_coverage_are_those_at_the_settled_instants() -> None:
    """Bias, root mean square error and coverage follow from the differences to the ground truth."""
    found = figures(made_up(1.0))
    assert found["instants"] == 29  # 30 settled, one of them without an estimate of the network
    assert found["posterior_rmse_cohesion_kPa"] == pytest.approx(0.2 * np.sqrt((15 * 1.5**2 + 14 * 0.5**2) / 29))
    assert found["posterior_bias_friction_angle_deg"] == pytest.approx((15 * 1.5 - 14 * 0.5) / 29)
    assert found["network_rmse_cohesion_kPa"] == pytest.approx(1.0)
    assert found["network_bias_friction_angle_deg"] == pytest.approx(-1.0)
    assert found["posterior_coverage_90_cohesion_kPa"] == 1.0
    assert found["posterior_coverage_90_friction_angle_deg"] == pytest.approx(14 / 29)
    assert len(found) == 11


def result(case: Case, *, names: tuple[str, ...], verdict: str, changes: tuple[str, ...] = ()) -> LoopResult:
    """Return the outcome of a case with made-up estimates."""
    drivetrain = {**case.known, **({"no_load_current_A": 0.0382} if changes else {})}
    fit = {"held_out_rmse_before": 0.004, "held_out_rmse_after": 0.001}
    answer = {"verdict": verdict, "effects": [{"name": name} for name in names], "fit": fit}
    return LoopResult(
        case,
        answer,
        {"verdict": "consistent"},
        changes,
        Configuration.model_validate({"drivetrain": drivetrain}),
        made_up(4.0),
        made_up(1.0),
        made_up(0.5),
    )


def results() -> list[LoopResult]:
    """Return one outcome of each kind."""
    viscous = result(VISCOUS, names=("viscous-friction",), verdict="effects", changes=("viscous 0 → 41",))
    drivetrain = viscous.configuration.drivetrain.model_copy(update={"viscous_current_A_s_per_rad": (4.1e-5,) * 6})
    viscous = replace(viscous, configuration=viscous.configuration.model_copy(update={"drivetrain": drivetrain}))
    return [
        result(COULOMB, names=("coulomb-friction",), verdict="effects", changes=("no_load_current_A 0 → 0.0382",)),
        viscous,
        result(NOTHING, names=(), verdict="consistent"),
        result(NOTHING, names=(), verdict="unexplained"),
    ]


def test_the_summary_is_one_sentence_for_each_case() -> None:
    """Hidden effect, named effects with the corrected constants, and the errors before and after."""
    hidden = 1e3 * COULOMB.hidden["no_load_current_A"]
    viscous = 1e6 * VISCOUS.hidden["viscous_current_A_s_per_rad"]
    corrected = "rover.toml corrected; error on other soils: c 0.91 → 0.23 kPa and φ 4.53 → 1.13 °."
    found = "viscous-friction (I₀ = 38.2 mA + 41.0 µA s/rad · ω)"
    assert [summary.sentence(each) for each in results()] == [
        f"Hidden: {hidden:.1f} mA of constant friction; found: coulomb-friction (I₀ = 38.2 mA); {corrected}",
        f"Hidden: {viscous:.1f} µA s/rad of viscous friction; found: {found}; {corrected}",
        "Hidden: nothing; found: nothing; rover.toml unchanged.",
        "Hidden: nothing; found: an unexplained difference; rover.toml unchanged.",
    ]


def test_the_figures_of_all_cases_are_flat() -> None:
    """A found current is the difference to the known one; right is a case whose names are exactly those hidden."""
    flat = summary.figures_of(results()[:3])
    assert [flat[f"{name}_right"] for name in ("coulomb", "viscous", "nothing")] == [True, True, True]
    assert [flat[f"{name}_configuration_changed"] for name in ("coulomb", "viscous", "nothing")] == [True, True, False]
    assert flat["coulomb_named"] == "coulomb-friction"
    assert flat["coulomb_verdict"] == "effects"
    assert flat["coulomb_corrected_simulation_verdict"] == "consistent"
    assert flat["coulomb_found_no_load_current_A"] == pytest.approx(0.0382)
    assert flat["coulomb_hidden_no_load_current_A"] == COULOMB.hidden["no_load_current_A"]
    assert flat["coulomb_hidden_viscous_current_A_s_per_rad"] == 0.0
    assert flat["viscous_found_no_load_current_A"] == pytest.approx(0.0012)
    assert flat["viscous_found_viscous_current_A_s_per_rad"] == pytest.approx(4.1e-5)
    assert (flat["nothing_held_out_rmse_before_A"], flat["nothing_held_out_rmse_after_A"]) == (0.004, 0.001)
    before, true = flat["coulomb_before_instants"], flat["coulomb_true_drivetrain_posterior_rmse_cohesion_kPa"]
    assert before == 29
    assert true < flat["coulomb_after_posterior_rmse_cohesion_kPa"] < flat["coulomb_before_posterior_rmse_cohesion_kPa"]
    wrong = replace(results()[0], answer={**results()[0].answer, "effects": []}, changes=())
    wrong.answer["verdict"] = "consistent"
    assert summary.figures_of([wrong])["coulomb_right"] is False


def test_the_picture_shows_every_case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lines, bands, bars, labels and limits are those that were reviewed; an SVG of equal results is equal."""
    drawn: list[Figure] = []
    save = Figure.savefig

    def keep(self: Figure, *arguments: Any, **options: Any) -> None:
        drawn.append(self)
        save(self, *arguments, **options)

    monkeypatch.setattr(Figure, "savefig", keep)
    for name in ("one.svg", "two.svg"):
        picture.draw(results()[:3:2], tmp_path / "folder" / name)
    assert_golden(description(drawn[0]), GOLDEN / "picture.txt")
    assert (tmp_path / "folder/one.svg").read_bytes() == (tmp_path / "folder/two.svg").read_bytes()


@pytest.mark.parametrize(("names", "changed"), [(("coulomb-friction",), True), ((), False)])
def test_a_case_writes_the_correction_into_rover_toml_where_an_effect_was_named(
    names: tuple[str, ...], changed: bool, tmp_path: Path, network: TerrainNetwork, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both comparisons use the same recording, the second one the corrected simulation."""
    asked = []

    def compare(folder: Path, simulation: str, answer: str, corrected: str) -> dict[str, Any]:
        asked.append((simulation, answer, corrected, sorted(path.name for path in folder.iterdir())))
        text = sim_toml(COULOMB).replace("gain_relative_std", "no_load_current_A = 0.036\ngain_relative_std", 1)
        (folder / corrected).write_text(text)
        return {"verdict": "effects", "effects": [{"name": name} for name in names], "fit": {}}

    monkeypatch.setattr(run, "_compare", compare)
    said: list[str] = []
    folder = tmp_path / "coulomb"
    (folder / "old").mkdir(parents=True)
    lengths = DriveLengths(first_s=8.0, second_s=10.0, stretch_m=0.05)
    found = run_case(COULOMB, 5, folder, network, lengths, said.append)
    assert not (folder / "old").exists()
    assert asked == [
        ("SIM.toml", "answer.json", "NEW.toml", ["SIM.toml", "drive.mcap"]),
        ("NEW.toml", "corrected-answer.json", "NEW2.toml", ["NEW.toml", "SIM.toml", "drive.mcap"]),
    ]
    assert len(said) == 4
    assert found.names == names
    assert bool(found.changes) == (folder / "rover-before.toml").exists() == changed
    assert found.configuration.drivetrain.no_load_current_A[0] == (0.036 if changed else 0.0)
    assert len(found.before.time_s) == len(found.after.time_s) == len(found.with_true_drivetrain.time_s) == 20
    assert (DriveLengths().first_s, DriveLengths().second_s, DriveLengths().stretch_m) == (1200.0, 720.0, 4.5)


def test_a_comparison_is_a_separate_process_without_the_truth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`regolithd mismatch` runs in the folder with one thread and half an hour, and its JSON answer is returned."""
    called: dict[str, Any] = {}

    def isolated(command: list[str], folder: Path, *, threads: int, timeout_s: float) -> None:
        called.update(command=command[1:], folder=folder, threads=threads, timeout_s=timeout_s)
        (folder / "answer.json").write_text('{"verdict": "consistent"}')

    monkeypatch.setattr(run, "run_isolated", isolated)
    assert run._compare(tmp_path, "SIM.toml", "answer.json", "NEW.toml") == {"verdict": "consistent"}
    assert " ".join(called["command"]) == (
        "-m regolithd mismatch drive.mcap --simulation SIM.toml --json answer.json --corrected NEW.toml "
        "--report SIM.html"
    )
    assert (called["folder"], called["threads"], called["timeout_s"]) == (tmp_path, 1, 1800.0)


def test_the_drivetrain_of_the_picture_is_the_default_one() -> None:
    """A case without known constants draws the drag of a drivetrain without friction."""
    assert Drivetrain.model_validate(COULOMB.known).no_load_current_A == (0.0,) * 6
