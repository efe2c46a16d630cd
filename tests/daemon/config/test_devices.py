"""`[devices]`: what it describes, and what is said about mistakes."""

from __future__ import annotations

from pathlib import Path

import pytest

from regolithd.daemon.config.reader import ConfigurationError, parse_configuration, read_configuration
from regolithd.daemon.service import network_settings
from regolithd.drivers.devices.eds import EDS_FOLDER
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER, MOTOR_SPEED

ROVER = Path("rover.toml")


def problems(text: str) -> list[str]:
    """Return every problem of a text, one line each."""
    with pytest.raises(ConfigurationError) as caught:
        parse_configuration(text, ROVER)
    return [str(problem) for problem in caught.value.problems]


def test_one_line_describes_all_motors() -> None:
    """A profile is enough: six drives with the objects of an EPOS4, and equal tables are one device."""
    devices = {
        node.device for node in parse_configuration('[devices.motors]\nprofile = "epos4"\n', ROVER).described()[:6]
    }
    assert len(devices) == 1
    places = [(each.index, each.subindex) for layout in devices.pop().tpdos for each in layout.objects]
    assert places == [(0x6041, 0), (0x30D1, 2), (0x606C, 0)]


def test_the_table_of_a_node_stands_in_place_of_that_of_its_kind() -> None:
    """Mixed drives: node 3 is another make, and has nothing of the motors' table."""
    text = """
    [devices.motors]
    profile = "epos4"
    vendor = 0xFB
    [devices.3]
    profile = "cia402"
    revisions = [0x00010000, 0x0002FFFF]
    serial = 77
    """
    nodes = {node.node_id: node for node in parse_configuration(text, ROVER).described()}
    assert nodes[2].device.identity.vendor == 0xFB
    assert nodes[3].device.identity.vendor is None
    assert nodes[3].device.identity.revisions == (0x00010000, 0x0002FFFF)
    assert (nodes[3].serial, nodes[2].serial) == (77, None)


def test_without_a_table_the_device_is_that_of_the_registry() -> None:
    """Nothing changes for a rover that describes no device."""
    assert parse_configuration("", ROVER).described()[0].device is MOTOR_CONTROLLER


def test_an_object_and_its_unit_are_taken_as_stated() -> None:
    """`objects` places a quantity elsewhere; the speed's unit is that of the command as well."""
    text = """
    [devices.motors.objects]
    motor_current_A = {object = "0x2027", unit = "mA"}
    motor_speed_rad_s = {scale = 0.01}
    """
    device = parse_configuration(text, ROVER).described()[0].device
    found = {each.index: each.scale for layout in device.tpdos for each in layout.objects}
    assert (found[0x2027], found[0x606C]) == (1e-3, 0.01)
    assert [each.scale for layout in device.rpdos for each in layout.objects if each.index == 0x60FF] == [0.01]
    assert MOTOR_SPEED in device.quantities


def test_an_eds_file_is_relative_to_the_configuration(tmp_path: Path) -> None:
    """A relative `eds` lies in the folder of `rover.toml`, wherever the daemon is started."""
    (tmp_path / "mine.eds").write_bytes((EDS_FOLDER / "epos4.eds").read_bytes())
    (tmp_path / "rover.toml").write_text('[devices.motors]\nprofile = "epos4"\neds = "mine.eds"\n')
    assert read_configuration(tmp_path / "rover.toml").described()[0].device.eds == tmp_path / "mine.eds"


def test_time_limits_are_configured() -> None:
    """Boot and SDO time limits reach the network."""
    settings = network_settings(parse_configuration("[nodes]\nboot_timeout_s = 9\nsdo_timeout_s = 2\n", ROVER))
    assert (settings.boot_up_timeout_s, settings.sdo_timeout_s) == (9.0, 2.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            '[devices.motors]\nprofile = "epos5"',
            "there is no profile 'epos5' for motors. Take one of epos24, epos2, epos4",
        ),
        ('[devices.motors]\neds = "absent.eds"', "cannot be read: No such file or directory"),
        ('[devices.motors]\nprofle = "epos4"', "Did you mean profile?"),
        ('[devices.pumps]\nprofile = "epos4"', "devices.pumps: expected a kind of device of [nodes]"),
        ("[devices.99]", "devices.99: expected a kind of device of [nodes], or the id of a node"),
        ('[devices.load_cells]\nprofile = "cia401"', "State newtons per digit"),
        (
            '[devices.motors.objects]\nmotor_current_A = {object = "0x5555", unit = "mA"}',
            "object 0x5555:00, motor_current_A: the EDS file motor.eds has no such object. Correct object or unit",
        ),
        ('[devices.motors.objects]\nmotor_current_A = {object = "60G8"}', "index and sub-index in hexadecimal"),
        (
            '[devices.motors.objects]\nmotor_current_A = {unit = "N"}',
            "motor_current_A cannot be in the unit 'N'. Take one of A, mA",
        ),
        ("[devices.motors.objects]\nmotor_speed_rad_s = {scale = 1e6}", "absurd scale: one step of the raw value"),
        (
            "[devices.motors.objects]\nmotor_current_A = {scale = 1e-12}",
            "absurd scale: all values together would cover only",
        ),
        (
            '[devices.motors.objects]\nmotor_currant_A = {unit = "mA"}',
            "a motor has no quantity 'motor_currant_A'. It has statusword",
        ),
        ('[devices.motors.objects]\nmotor_current_A = {object = "0x6083"}', "may not be mapped to a PDO"),
        ('[devices.motors.settings]\n"0x605A" = 99999', "cannot be set to 99999: its type goes from -32768 to 32767"),
    ],
)
def test_a_mistake_is_one_problem_with_its_cure(text: str, said: str) -> None:
    """Each mistake names its key, what was found, and what to do."""
    found = problems(text + "\n")
    assert len(found) == 1, found
    assert said in found[0]
    assert found[0].startswith("rover.toml:1: devices.") or found[0].startswith("rover.toml:2: devices.")


def test_the_cure_of_a_missing_object_is_not_what_was_just_done() -> None:
    """Who names the EDS of an EPOS4 and no profile is told to choose the profile, not to put the EDS in place."""
    found = problems(f'[devices.motors]\neds = "{EDS_FOLDER}/epos4.eds"\n')
    assert len(found) == 1
    assert "object 0x6078:00" in found[0]
    assert "Choose the profile of this device (epos2, epos4, cia402), or say where it lies" in found[0]
    assert "EDS file in its place" not in found[0]


def test_all_mistakes_are_reported_together() -> None:
    """Problems of two tables, and one of another table of the file, come in one go."""
    text = """
    [devices.motors]
    profile = "epos5"
    [devices.load_cells]
    profile = "cia401"
    [mqtt]
    password_file = "x"
    """
    assert len(problems(text)) == 3


def test_a_brake_is_no_intruder() -> None:
    """The master knows that the node is there."""
    settings = network_settings(parse_configuration("[brakes.31]\nwheel = 1\n", ROVER))
    assert settings.other_node_ids == {31}
