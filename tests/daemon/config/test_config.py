"""A configuration is either valid, or every mistake in it is reported at once."""

from pathlib import Path

import pytest

from regolithd.daemon.config.configuration import Brake, Configuration
from regolithd.daemon.config.devices import DeviceTable
from regolithd.daemon.config.reader import ConfigurationError, parse_configuration, read_configuration

ROVER = Path(__file__).resolve().parents[3] / "rover.toml"


def problems_of(text: str) -> dict[str, str]:
    """Return key → message of every problem."""
    with pytest.raises(ConfigurationError) as caught:
        parse_configuration(text, Path("rover.toml"))
    return {problem.key: str(problem) for problem in caught.value.problems}


OPTIONAL_TABLES = {"devices": (DeviceTable, "# [devices.motors]"), "brakes": (Brake, "# [brakes.31]")}


def test_the_shipped_file_is_the_defaults_with_both_body_sensors() -> None:
    """`rover.toml` has the default of every key, and both body sensors."""
    shipped = read_configuration(ROVER)
    sensors = shipped.nodes.model_copy(update={"inclinometer": None, "ground_speed": None})
    assert shipped.model_copy(update={"nodes": sensors}) == Configuration()
    assert len(shipped.described()) == 14


def test_every_key_of_the_model_is_shown_in_the_shipped_file() -> None:
    """Each table and each key of the model is in `rover.toml`."""
    text = ROVER.read_text()
    for name, field in Configuration.model_fields.items():
        table, header = OPTIONAL_TABLES.get(name, (field.annotation, f"[{name}]"))
        assert header in text
        for key in table.model_fields:  # type: ignore[union-attr]
            if key == "objects":
                continue
            assert f"{key} = " in text, f"{name}.{key}"


def test_five_mistakes_are_five_problems_with_file_line_key_and_remedy() -> None:
    """Each problem has its file, line, key and remedy, those between two keys included."""
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
    assert found["sync.rate_Hz"].startswith("rover.toml:2: sync.rate_Hz: expected 1 to 200 Hz, found 500.")
    assert found["nodes.motors[5]"].startswith("rover.toml:4: ")
    assert found["wheel.widht_m"].startswith("rover.toml:7: ")
    assert "Did you mean width_m?" in found["wheel.widht_m"]
    assert found["mqtt.port"].endswith("Change it, or leave it out for 1883.")


def test_a_brake_has_a_node_and_a_wheel_of_its_own() -> None:
    """Node-IDs that are taken, two brakes of one wheel, and what is no node-ID are problems."""
    found = problems_of("[brakes.3]\nwheel = 1\n[brakes.32]\nwheel = 1\n[brakes.33]\nwheel = 7\n")
    assert "brakes.33.wheel" in found
    found = problems_of("[brakes.3]\nwheel = 1\n[brakes.32]\nwheel = 1\n")
    assert found["brakes.3"].startswith(
        "rover.toml:1: brakes.3: expected a node id of its own, found 3, which is motors[2]"
    )
    assert found["brakes.32.wheel"].startswith("rover.toml:4: ")
    assert any("127" in text for text in problems_of("[brakes.127]\nwheel = 1\n").values())


def test_a_toml_mistake_is_reported_with_its_line() -> None:
    """A file that does not parse gives one problem with the line."""
    found = problems_of("[sync]\nrate_Hz = \n")
    assert found["syntax"].startswith("rover.toml:2: ")


def test_an_unknown_table_and_a_table_that_is_a_number_are_reported() -> None:
    """An unknown table and a table that is a number are problems too."""
    found = problems_of("sync = 3\n[recordings]\n")
    assert "Did you mean recording?" in found["recordings"]
    assert "sync" in found


def test_a_missing_file_is_a_problem_like_any_other(tmp_path: Path) -> None:
    """A missing file gives a problem, not a traceback."""
    with pytest.raises(ConfigurationError, match=r"absent.toml: file: expected a readable TOML file"):
        read_configuration(tmp_path / "absent.toml")


PATH_KEYS = (
    "estimator.model",
    "posterior.model",
    "recording.directory",
    "mqtt.password_file",
    "mqtt.socket",
    "mqtt.ca_file",
    "mqtt.cert_file",
    "mqtt.key_file",
    "mqtt.spool_directory",
    "control.socket",
)


BESIDE = {
    "password_file": 'username = "somebody"\n',
    "ca_file": "tls = true\n",
    "cert_file": 'tls = true\nkey_file = "key.pem"\n',
    "key_file": 'tls = true\ncert_file = "cert.pem"\n',
}
"""What a key needs beside it."""


def test_every_path_of_the_model_is_in_the_list_of_path_keys() -> None:
    """Every key of the model whose value is a path is tested below."""
    found = {
        f"{name}.{key}"
        for name, table in Configuration.model_fields.items()
        if name not in OPTIONAL_TABLES
        for key, field in table.annotation.model_fields.items()  # type: ignore[union-attr]
        if "Path" in str(field.annotation)
    }
    assert found == set(PATH_KEYS)


@pytest.mark.parametrize("name", PATH_KEYS)
def test_a_relative_path_is_relative_to_the_folder_of_the_file(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The working directory does not matter, whichever key the path is under."""
    table, key = name.split(".")
    file = tmp_path / "rover" / "rover.toml"
    file.parent.mkdir()
    file.write_text(f'[{table}]\n{key} = "below/mine"\n{BESIDE.get(key, "")}')
    monkeypatch.chdir(tmp_path)
    for given in (file, Path("rover/rover.toml")):
        assert getattr(getattr(read_configuration(given), table), key) == file.parent / "below" / "mine"


@pytest.mark.parametrize("name", PATH_KEYS)
def test_an_absolute_path_is_not_changed(name: str) -> None:
    """The folder of the file does not matter for an absolute path."""
    table, key = name.split(".")
    text = f'[{table}]\n{key} = "/some/where"\n{BESIDE.get(key, "")}'
    read = parse_configuration(text, Path("/etc/regolithd/rover.toml"))
    assert getattr(getattr(read, table), key) == Path("/some/where")


@pytest.mark.parametrize(
    ("text", "key", "found"),
    [
        ('tls = true\ncert_file = "a.pem"', "mqtt.key_file", "a file beside cert_file"),
        ('tls = true\nkey_file = "a.key"', "mqtt.cert_file", "a file beside key_file"),
        ('ca_file = "a.pem"', "mqtt.tls", "true beside ca_file"),
        ('cert_file = "a.pem"\nkey_file = "a.key"', "mqtt.tls", "true beside cert_file"),
        ('password_file = "a"', "mqtt.username", "a name beside password_file"),
    ],
)
def test_credentials_of_which_a_part_is_missing_are_reported(text: str, key: str, found: str) -> None:
    """A certificate needs its key, and both need TLS; otherwise a connection would be made without them."""
    assert found in problems_of(f"[mqtt]\n{text}\n")[key]


def test_only_the_motors_of_the_mirrored_wheels_are_mirrored() -> None:
    """`mirrored_wheels` counts wheels from 1, and applies to motors only."""
    nodes = parse_configuration("[nodes]\nmirrored_wheels = [2, 6]\ninclinometer = 21\n", Path("rover.toml")).nodes
    described = Configuration(nodes=nodes).described()
    assert [node.node_id for node in described if node.mirrored] == [2, 6]
    assert [node.wheel for node in described if node.mirrored] == [1, 5]


def test_motor_diagnostics_are_of_the_motors_alone() -> None:
    """`motor_diagnostics` applies to motors only."""
    nodes = parse_configuration("[nodes]\nmotor_diagnostics = true\n", Path("rover.toml")).nodes
    assert [node.node_id for node in Configuration(nodes=nodes).described() if node.diagnostics] == [1, 2, 3, 4, 5, 6]


def test_a_wrong_element_of_a_list_is_reported_with_its_place() -> None:
    """The key of the problem has the element's index, from 0, and the list itself is not reported as too short."""
    assert set(problems_of("[nodes]\nmotors = [1, 2, 3, 4, 5, 300]\n")) == {"nodes.motors[5]"}
    assert set(problems_of("[nodes]\nmotors = [1, 300]\n")) == {"nodes.motors[1]", "nodes.motors"}
    assert set(problems_of("[nodes]\nload_cells = [1, 12, 13, 14, 15, 16]\n")) == {"nodes.load_cells[0]"}
