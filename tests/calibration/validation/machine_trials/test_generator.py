"""The generators: apart from the solver, the same from the same seed, and honest about what they conceal."""

from __future__ import annotations

import ast
import csv
import gzip
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from regolithd.calibration.validation import machine_trials
from regolithd.calibration.validation.machine_trials.cases.files import write_recording
from regolithd.calibration.validation.machine_trials.cases.generator import Case, draw, make_case
from regolithd.calibration.validation.machine_trials.cases.plan import (
    KINDS,
    NEEDING,
    TURN,
    Plan,
    can_have,
    plan_batch,
    plan_case,
)
from regolithd.calibration.validation.machine_trials.cases.strength import (
    NoiseLaw,
    delayed,
    of_strength,
    readings,
    relative_strength,
    whitened,
)
from regolithd.calibration.validation.machine_trials.machines import MACHINES
from regolithd.calibration.validation.machine_trials.physics.machine import Effect, Schedule, World
from regolithd.calibration.validation.machine_trials.physics.signals import correlated_noise, moves

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOM = Path(machine_trials.__file__).parent
OWN, SEALING = "regolithd.calibration.validation.machine_trials", "regolithd.calibration.validation.blind_trials"
SHORT = {"two-tanks": Schedule(2, 2400), "oven": Schedule(1, 6000)}


@pytest.fixture(autouse=True)
def _short_recordings(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every machine's recordings be short."""
    for name, machine in MACHINES.items():
        monkeypatch.setitem(MACHINES, name, replace(machine, schedules=(schedule_of(name),)))


def schedule_of(machine: str) -> Schedule:
    """Return a short schedule for a machine."""
    return SHORT.get(machine, Schedule(50, 120))


def short_world(machine: str, seed: int = 3) -> World:
    """Return a machine with its stated parameters on a short drive."""
    found = MACHINES[machine]
    drive = found.drive(np.random.default_rng(seed), schedule_of(machine))
    return World(found, drive, {name: known.value for name, known in found.parameters.items()})


def every_effect() -> Iterator[tuple[str, str]]:
    """Yield every machine with everything that it may conceal."""
    for name, machine in MACHINES.items():
        yield from ((name, effect) for effect in (*machine.effects, *machine.outside))


@pytest.mark.parametrize("path", sorted(ROOM.rglob("*.py")), ids=lambda path: str(path.relative_to(ROOM)))
def test_nothing_here_imports_the_solver(path: Path) -> None:
    """Of this project the trials import themselves, and of the rover's trials what seals and isolates."""
    tree = ast.parse(path.read_text())
    names = {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    names |= {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    foreign = {name for name in names if name.startswith("regolithd") and not name.startswith(OWN)}
    assert foreign <= {f"{SEALING}.{module}" for module in ("commitment", "errors", "isolation")}


@pytest.mark.parametrize("machine", list(MACHINES))
def test_the_same_plan_makes_the_same_recording(machine: str, tmp_path: Path) -> None:
    """Machine, kind, seed and index make a recording to the last byte, and another index makes another."""
    written = []
    for at, index in enumerate((0, 0, 1)):
        plan = Plan(at, 5, machine, "nothing", index, ())
        case = make_case(plan)
        path = write_recording(case.first, case.machine.base_units, tmp_path / f"{at}.csv.gz")
        written.append(path.read_bytes())
    assert written[0] == written[1]
    assert written[0] != written[2]


@pytest.mark.parametrize(("machine", "kind"), list(every_effect()))
def test_each_effect_has_the_stated_strength(machine: str, kind: str) -> None:
    """Every effect can be made 12 % of the mean absolute prediction, and acts on its axes alone from its onset on."""
    world = short_world(machine)
    maker = {**world.machine.effects, **world.machine.outside}[kind]
    effect = of_strength(world, maker(np.random.default_rng(1), world), 0.12)
    assert effect.strength == pytest.approx(0.12, rel=0.02)
    added = readings(world, [effect])[effect.channel] - world.base[effect.channel]
    acting = world.drive.compared[:, list(effect.axes)]
    if effect.onset_s is not None:
        before = world.drive.t_s < effect.onset_s
        assert not np.any(np.abs(added[before]) > 1e-9)
        acting = acting & ~before[:, None]
    power = np.mean(added[:, list(effect.axes)][acting] ** 2)
    assert np.sqrt(power) / world.mean_size(effect.channel) == pytest.approx(effect.strength, rel=1e-6)
    others = [axis for axis in world.machine.every_axis if axis not in effect.axes]
    assert not np.any(np.abs(added[:, others]) > 1e-9)


@pytest.mark.parametrize("machine", list(MACHINES))
def test_effects_are_named_as_in_the_contract_and_the_others_have_no_name(machine: str) -> None:
    """What is in a machine's list bears the name that it is listed under, and what is outside bears none."""
    world = short_world(machine)
    for name, maker in world.machine.effects.items():
        assert maker(np.random.default_rng(1), world).name == name
    for kind, maker in world.machine.outside.items():
        effect = maker(np.random.default_rng(1), world)
        assert (effect.name, effect.kind) == (None, kind)


@pytest.mark.parametrize("machine", list(MACHINES))
def test_noise_is_about_a_third_of_the_mean_and_remembers(machine: str) -> None:
    """On every channel the true model leaves 27–33 % of the mean absolute prediction, correlated in time."""
    first = make_case(plan_case(0, 5, machine, "nothing", 0)).first
    for channel, values in first.measured.items():
        left = (values - readings(first.world, ())[channel])[:, 0]
        assert 0.23 < np.std(left) / first.world.mean_size(channel) < 0.37
        assert np.corrcoef(left[1:], left[:-1])[0, 1] > 0.3


@pytest.mark.parametrize("machine", list(MACHINES))
def test_parameters_lie_within_their_priors_but_for_one(machine: str) -> None:
    """Parameters are off by up to 1.5 deviations, and in `parameter-off` exactly one by 4.5 to 6."""
    for kind, expected in (("nothing", 0), ("parameter-off", 1)):
        case = draw(plan_case(0, 5, machine, kind, 0), MACHINES[machine], np.random.default_rng(2), 0.05)
        known = case.machine.parameters
        away = np.array([abs(case.first.world.values[n] - k.value) / k.std for n, k in known.items()])
        assert np.sum(away > 4.4) == expected
        assert np.all((away <= 1.5) | ((away >= 4.5) & (away <= 6)))


@pytest.mark.parametrize("kind", ["corrected-unchanged", "corrected-grown", "corrected-gone", "corrected-new"])
def test_a_later_recording_holds_the_same_machine_and_what_has_changed(kind: str) -> None:
    """The later recording has the parameters of the first, another drive, and the effect as the kind says."""
    case: Case = make_case(plan_case(0, 5, "agv-drive", kind, 0))
    assert case.later is not None
    first, later = case.first, case.later
    assert first.world.values == later.world.values
    assert not np.array_equal(first.measured["motor_current_A"], later.measured["motor_current_A"])
    sizes: dict[str | None, float] = {effect.name: effect.size for effect in later.effects}
    (old,) = first.effects
    ratio = {"corrected-grown": 1.8, "corrected-gone": 0.0}.get(kind, 1.0)
    assert sizes.get(old.name, 0.0) == pytest.approx(ratio * old.size)
    assert len(sizes) == {"corrected-gone": 0, "corrected-new": 2}.get(kind, 1)


def test_slow_and_blank_columns_are_blank_in_the_file(tmp_path: Path) -> None:
    """A slow sensor speaks once a second beside 100 Hz, and a blank column lacks about 30 % of its rows."""
    for kind, low, high in (("slow", 0.005, 0.21), ("blank", 0.6, 0.8)):
        case = make_case(plan_case(0, 5, "servo-joint", kind, 0))
        path = write_recording(case.first, case.machine.base_units, tmp_path / f"{kind}.csv.gz")
        with gzip.open(path, "rt") as text:
            rows = list(csv.DictReader(text))
        there = [row["motor_temperature_degC"] != "" for row in rows]
        assert low < np.mean(there) < high
        assert all(row["motor_current_A"] for row in rows)


@pytest.mark.parametrize("machine", list(MACHINES))
def test_other_units_change_names_and_numbers_alone(machine: str, tmp_path: Path) -> None:
    """In other units the columns have other names, and scale and offset lead back to the same numbers."""
    case = make_case(plan_case(0, 5, machine, "units", 0))
    tables = []
    for at, units in enumerate(case.units):
        path = write_recording(case.first, units, tmp_path / f"{at}.csv.gz")
        with gzip.open(path, "rt") as text:
            tables.append(list(csv.DictReader(text)))
    base, other = case.units
    assert len(tables[0]) == len(tables[1])
    for old, new, scale, offset in other.changes:
        assert new not in tables[0][0]
        assert old not in tables[1][0]
        for row in (0, -1):
            expected = scale * float(tables[0][row][base.renamed(old)]) + offset
            assert float(tables[1][row][new]) == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_a_batch_gives_every_machine_every_kind() -> None:
    """A hundred cases hold each machine with each place in the order of kinds, and cases can be made again alone."""
    plans = plan_batch(9, 5 * len(TURN))
    every = {(m, k) for m, one in MACHINES.items() for k in KINDS if can_have(one, k)}
    assert {(plan.machine, plan.kind) for plan in plans} == every
    assert ("agv-drive", "parameter-off") not in every
    chosen = plans[37]
    (again,) = plan_batch(9, 1, chosen.machine, chosen.kind, chosen.index)
    assert (again.names, again.index) == (chosen.names, chosen.index)
    assert again.rng.integers(10**9) == chosen.rng.integers(10**9)


def test_columns_that_an_effect_needs_are_recorded() -> None:
    """What `slow` and `blank` take away is a column or channel of its machine, and NEEDING names effects that exist."""
    for machine in MACHINES.values():
        world = short_world(machine.name)
        for column in (machine.slow_column, machine.blank_column):
            assert column in {**world.drive.columns, **machine.channels}
            for name in set(NEEDING.get(column, ())) & set(machine.effects):
                assert column in machine.effects[name](np.random.default_rng(1), world).needs


def test_moves_have_the_derivatives_that_they_claim() -> None:
    """Rate and acceleration of a path are its first and second derivative in time."""
    t_s = np.arange(0, 40, 0.001)
    path, rate, acceleration = moves(np.random.default_rng(4), t_s, lambda r: r.uniform(-1, 1), (0.5, 2), (0, 1))
    np.testing.assert_allclose(np.gradient(path, t_s), rate, atol=0.02)
    np.testing.assert_allclose(np.gradient(rate, t_s)[2:-2], acceleration[2:-2], atol=0.15)


def test_noise_has_the_spectrum_that_the_margin_is_measured_with() -> None:
    """The mean periodogram of the noise agrees with its stated spectrum, low frequencies and high."""
    noise = correlated_noise(np.random.default_rng(6), 4096, 200, 0.9, 0.2)
    power = np.mean(np.abs(np.fft.rfft(noise, axis=0)) ** 2, axis=1) / len(noise)
    angle = 2 * np.pi * np.fft.rfftfreq(4096)
    stated = 0.8 * (1 - 0.9**2) / (1 - 2 * 0.9 * np.cos(angle) + 0.9**2) + 0.2
    for part in (slice(1, 60), slice(300, 600), slice(1500, 2000)):
        assert np.mean(power[part] / stated[part]) == pytest.approx(1, rel=0.05)


@pytest.mark.parametrize("absent", ["none", "single rows", "a spell"])
def test_margins_are_exact_with_rows_that_are_not_seen(absent: str) -> None:
    """The squares of the innovations are what the noise's covariance over the seen rows gives."""
    rng, rows, law = np.random.default_rng(3), 300, NoiseLaw(0.95, 0.2, {})
    row = np.arange(rows)
    seen = {"none": row >= 0, "single rows": rng.uniform(size=rows) < 0.7, "a spell": (row < 90) | (row > 150)}[absent]
    values = np.cumsum(rng.standard_normal(rows))
    covariance = 4.0 * (0.8 * law.phi ** np.abs(row[:, None] - row) + 0.2 * np.eye(rows))
    exact = values[seen] @ np.linalg.solve(covariance[np.ix_(seen, seen)], values[seen])
    found = whitened(values[:, None], law, 2.0, seen[:, None])
    assert np.sum(found**2) == pytest.approx(exact, rel=1e-9)
    assert not np.any(found[~seen])


def test_a_delay_to_be_found_is_longer_than_a_row() -> None:
    """What is called late is late by more than the time between two rows."""
    case = make_case(plan_case(0, 5, "agv-drive", "late", 0))
    assert case.first.effects[0].size > 1.5 * case.first.world.drive.step_s


def test_a_late_channel_is_the_same_channel_later() -> None:
    """A delay of whole rows shifts a channel by those rows, and each run begins with its own first reading."""
    world = short_world("two-tanks")
    values = world.base["load_N"]
    late = delayed(world, values, 25 * world.drive.step_s)
    half = len(values) // 2
    np.testing.assert_allclose(late[25:half], values[: half - 25])
    np.testing.assert_allclose(late[half : half + 25], np.tile(values[half], (25, 1)))


def test_strength_grows_with_size() -> None:
    """Twice the size of an effect that is added is twice its strength."""
    world = short_world("servo-joint")
    effect: Effect = world.machine.effects["coulomb-friction"](np.random.default_rng(1), world)
    one = of_strength(world, effect, 0.05)
    two = of_strength(world, effect, 0.10)
    assert two.size / one.size == pytest.approx(2, rel=0.01)
    assert relative_strength(world, two) == pytest.approx(0.10, rel=0.01)
