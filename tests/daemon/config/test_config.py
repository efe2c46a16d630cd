"""A configuration is either right, or every mistake in it is told at once."""

from pathlib import Path

import pytest

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.config.reader import ConfigurationError, parse_configuration, read_configuration

ROVER = Path(__file__).resolve().parents[3] / "rover.toml"


def problems_of(text: str) -> dict[str, str]:
    """Return key → message of everything that is wrong."""
    with pytest.raises(ConfigurationError) as caught:
        parse_configuration(text, Path("rover.toml"))
    return {problem.key: str(problem) for problem in caught.value.problems}


def test_the_shipped_file_is_the_defaults_with_both_body_sensors() -> None:
    """`rover.toml` promises that its values are the defaults."""
    shipped = read_configuration(ROVER)
    sensors = shipped.nodes.model_copy(update={"inclinometer": None, "ground_speed": None})
    assert shipped.model_copy(update={"nodes": sensors}) == Configuration()
    assert len(shipped.nodes.described()) == 14


def test_every_key_of_the_model_is_shown_in_the_shipped_file() -> None:
    """A key that nobody can see does not exist."""
    text = ROVER.read_text()
    for name, field in Configuration.model_fields.items():
        assert f"[{name}]" in text
        for key in field.annotation.model_fields:  # type: ignore[union-attr]
            assert f"{key} = " in text, f"{name}.{key}"


def test_five_mistakes_are_five_problems_with_file_line_key_and_cure() -> None:
    """Among them one that only shows when two keys are looked at together."""
    text = """\
[sync]
rate_Hz = 500
[nodes]
motors = [1, 2, 3, 4, 5, 5]
[wheel]
radius_m = -0.075
widht_m = 0.07
[mqtt]
port = "1883a"
"""
    found = problems_of(text)
    assert set(found) == {"sync.rate_Hz", "nodes.motors[5]", "wheel.radius_m", "wheel.widht_m", "mqtt.port"}
    assert found["sync.rate_Hz"].startswith(
        "rover.toml:2: sync.rate_Hz: expected less than or equal to 200, found 500."
    )
    assert found["nodes.motors[5]"].startswith("rover.toml:4: ")
    assert found["wheel.widht_m"].startswith("rover.toml:7: ")
    assert "Did you mean width_m?" in found["wheel.widht_m"]
    assert found["mqtt.port"].endswith("Change it, or leave it out for 1883.")


def test_a_toml_mistake_is_told_with_its_line() -> None:
    """Nothing can be said about the rest then."""
    found = problems_of("[sync]\nrate_Hz = \n")
    assert found["syntax"].startswith("rover.toml:2: ")


def test_an_unknown_table_and_a_table_that_is_a_number_are_told() -> None:
    """The shape of the file is checked like its values."""
    found = problems_of("sync = 3\n[recordings]\n")
    assert "Did you mean recording?" in found["recordings"]
    assert "sync" in found


def test_a_missing_file_is_a_problem_like_any_other(tmp_path: Path) -> None:
    """`--config` mistyped is told, not traced."""
    with pytest.raises(ConfigurationError, match=r"absent.toml: file: expected a readable TOML file"):
        read_configuration(tmp_path / "absent.toml")


def test_model_paths_are_relative_to_the_file(tmp_path: Path) -> None:
    """A configuration and its network may be moved together."""
    path = tmp_path / "rover.toml"
    path.write_text('[estimator]\nmodel = "mine.onnx"\n')
    assert read_configuration(path).estimator.model == tmp_path / "mine.onnx"
