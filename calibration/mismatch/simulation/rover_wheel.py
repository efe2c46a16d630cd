"""The built-in simulation: six driven wheels on soil, current from load, slip and soil (Eqs 1, 6, 7 and 11)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from regolithd.calibration.drivetrain.torque import motor_current
from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.errors import RecordingError, SimulationError, did_you_mean
from regolithd.calibration.mismatch.problem.inputs.errors_in_variables import known_mean
from regolithd.calibration.mismatch.problem.prior import Prior, SensorError, own_name
from regolithd.calibration.mismatch.simulation.open_circuit_voltage import open_circuit_voltage
from regolithd.calibration.mismatch.simulation.simulation import Simulation
from regolithd.calibration.parameters import Drivetrain, Rover, Sensors, Soil, Table, Wheel
from regolithd.calibration.terrain.wheel_soil import LARGEST_CONTACT_ANGLE_RAD, contact_angle, wheel_torque

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Shape
    from regolithd.calibration.mismatch.data.recording import Recording

Array = NDArray[np.float64]

GRAVITY_M_S2 = 9.81
SLOWEST_RAD_S = 0.05
"""Wheel speed below which nothing is predicted: slip is a quotient of two small numbers there (a choice)."""
WHEELS = 6
"""Of the daemon's rover: `[drivetrain]` has a value for each."""
POWER_TOLERANCE = 1e-9
"""Difference from 1 of a viscous friction's power that is rounding."""
LIFTED_N = 1.0
"""Largest reading of a load cell under a wheel that hangs in its suspension (a choice: a few percent of a load)."""

OF_THE_ENGINE = frozenset({"effects", "empirical_curves"})
"""Tables that the engine adds to the prediction, whatever the simulation."""


class SimulationTable(Table):
    """SIM.toml's `[simulation]`."""

    model: str = "rover-wheel"
    slip_without_ground_speed: float = Field(default=0.025, gt=-1, lt=1)
    motor_constant_at_degC: float | None = None
    without_effects: tuple[str, ...] = ()


class RoverWheelTables(Table):
    """SIM.toml for `rover-wheel`; effects found earlier are read elsewhere."""

    simulation: SimulationTable
    drivetrain: Drivetrain = Drivetrain()
    wheel: Wheel = Wheel()
    rover: Rover = Rover()
    soil: Soil
    sensors: Sensors = Sensors()


class _Solved(NamedTuple):
    """A contact angle, and what it was solved for."""

    load_N: Array
    slip: Array
    soil: Soil
    contact_angle_rad: Array


class RoverWheel(Simulation):
    """Motor currents of a six-wheel rover; odd wheels left, even right, 1 and 2 in front."""

    channel = "motor_current_A"
    unit = "A"
    inputs = ("motor_speed_rad_s",)
    own_to_each_wheel: ClassVar = frozenset({"gain_factor"})
    parameter_effects: ClassVar = {
        "gain_factor": "drivetrain-gain",
        "cohesion_Pa": "soil-cohesion",
        "friction_angle_deg": "soil-friction-angle",
    }

    undefined_at_times: ClassVar = frozenset({"slip", "load", "place"})  # a wheel that stands, or hangs in the air
    unlikely_effects = frozenset({"quadratic-drag"})  # air at 0.1 m/s: some 10 µN
    one_way = False
    unloaded_experiment = "lift the wheels and spin all six at several speeds, both ways"
    # Slopes of 6° and 4°, arcs of 1 m and more at a few cm/s, half a day's warming, a sledge.
    experiment_spans: ClassVar = {"pitch": 0.1, "roll": 0.07, "yaw_rate": 0.03, "temperature": 15.0, "slip": 0.04}
    covariate_labels: ClassVar = {
        "wheel_speed": "wheel speed (rad/s)",
        "direction": "direction of rotation",
        "temperature": "motor temperature (°C)",
        "torque": "predicted motor current (A)",
        "wheel_acceleration": "wheel acceleration (rad/s²)",
        "wheel_angle": "wheel angle (rad)",
        "pitch": "pitch (rad, nose up)",
        "roll": "roll (rad, right side down)",
        "yaw_rate": "yaw rate (rad/s, to the left)",
        "slip": "slip",
        "load": "load (N)",
        "voltage": "bus voltage (V)",
        "wheel_row": "wheel row (front to rear)",
        "place": "distance along the track (m)",
    }

    def __init__(self, tables: RoverWheelTables) -> None:
        self.tables = tables
        self.parameters = _priors(tables)
        self.sensors = _sensors(tables.sensors)
        self._solved: _Solved | None = None

    @classmethod
    def from_tables(cls, tables: Mapping[str, Any]) -> Self:
        """Read SIM.toml's tables; one error names every mistake."""
        try:
            return cls(RoverWheelTables(**{name: table for name, table in tables.items() if name not in OF_THE_ENGINE}))
        except ValidationError as error:
            raise _mistakes(error) from error

    def prepare(self, recording: Recording) -> Recording:
        """Add `slip`, and the load where no cell measured it; take the motors' sag out of the voltage."""
        if wrong := [wheel for wheel in recording.wheels if wheel not in range(1, WHEELS + 1)]:
            raise RecordingError(
                f"column wheel holds {wrong[0]}; it has to number the wheels 1 to {WHEELS}, odd left, 1 and 2 in front"
            )
        speed = self._wheel_speed(recording.channels)
        turning = np.abs(speed) > SLOWEST_RAD_S
        rim = np.where(turning, self.tables.wheel.radius_m * speed, np.nan)
        ground = recording.channel("ground_speed_m_s")
        slip = np.where(np.isfinite(ground), 1 - ground / rim, self.tables.simulation.slip_without_ground_speed)
        load = recording.channel("load_N")
        lifted = _lifted(load)
        slip = np.where(turning & ~lifted, slip, np.nan)
        never = ~np.isfinite(load).any(axis=0)
        share = self.tables.rover.mass_kg * GRAVITY_M_S2 / recording.shape[1]
        assumed = self.tables.simulation.slip_without_ground_speed
        notes = []
        if never.any():
            notes.append(f"Where load_N was never measured, the wheel is taken to carry {share:.1f} N.")
        if lifted.any():
            notes.append(f"No cell carries {LIFTED_N:g} N in {int(lifted.sum())} instants: the wheels turn in the air.")
        if blank := int(np.sum(turning & ~np.isfinite(ground) & ~lifted)):
            notes.append(
                f"ground_speed_m_s is blank at {blank} turning wheels' readings; slip is taken as {assumed:g}."
            )
        on_ground = np.where(never, share, np.where(lifted, np.nan, load))
        channels = {"slip": slip, "load_N": on_ground, "lifted": np.broadcast_to(lifted.astype(np.float64), load.shape)}
        if "bus_voltage_V" in recording.channels and "motor_current_A" in recording.channels:
            voltage, current = recording.channels["bus_voltage_V"], recording.channels["motor_current_A"]
            channels["bus_voltage_V"] = open_circuit_voltage(voltage, current)
        return recording.with_channels(**channels).with_notes(*notes)

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the motor currents [A], shape (time, wheel)."""
        tables = self.tables
        soil = tables.soil.model_copy(
            update={
                "cohesion_Pa": values["cohesion_Pa"],
                "friction_angle_deg": values["friction_angle_deg"],
                "shear_modulus_m": tables.soil.shear_modulus_m * values.get("shear_factor", 1.0),
                "k_phi_kN": tables.soil.k_phi_kN * values.get("stiffness_factor", 1.0),
                "k_c_kN": tables.soil.k_c_kN * values.get("stiffness_factor", 1.0),
            }
        )
        slip = inputs["slip"]
        speed = self._wheel_speed(inputs)
        angle = self._contact_angle(inputs["load_N"], slip, soil)
        if sinking := values.get("slip_sinkage", 0.0):
            angle = slip_sunk(angle, slip, sinking)
        torque = np.sign(speed) * wheel_torque(angle, slip, tables.wheel, soil) / values["gain_factor"]
        torque = np.where(inputs["lifted"] > 0, 0.0, torque)
        torque = np.where(np.abs(speed) > SLOWEST_RAD_S, torque, np.nan)
        if torque.shape[-1] != 6:
            return torque / tables.drivetrain.gain_Nm_per_A
        return motor_current(torque, inputs["motor_speed_rad_s"], tables.drivetrain)

    def _contact_angle(self, load_N: Array, slip: Array, soil: Soil) -> Array:
        """Return the contact angle; that of the call before, where only the drivetrain or the speed is another."""
        solved = self._solved
        if solved is None or solved.load_N is not load_N or solved.slip is not slip or solved.soil != soil:
            solved = _Solved(load_N, slip, soil, contact_angle(load_N, slip, self.tables.wheel, soil))
            self._solved = solved
        return solved.contact_angle_rad

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return everything measured that a missing effect may depend on."""
        named = {
            "temperature": "motor_temperature_degC",
            "voltage": "bus_voltage_V",
            "pitch": "pitch_rad",
            "roll": "roll_rad",
            "yaw_rate": "yaw_rate_rad_s",
            "load": "load_N",
            "slip": "slip",
        }
        found = {name: inputs[column] for name, column in named.items() if column in inputs}
        speed = self._wheel_speed(inputs)
        return {**found, "wheel_speed": speed, "time": inputs["t_s"], "place": self._place_m(inputs, speed)}

    def side(self, wheels: Sequence[int | str]) -> Array:
        """Odd wheels are on the left."""
        return np.array([-1.0 if int(wheel) % 2 else 1.0 for wheel in wheels])

    def row(self, wheels: Sequence[int | str]) -> Array:
        """1, 2 in front; 3, 4 in the middle; 5, 6 behind."""
        return np.array([(int(wheel) - 1) // 2 for wheel in wheels], np.float64)

    def contrasts(self, covariate: str, wheels: Sequence[int | str]) -> Mapping[str, Array]:
        """Roll and yaw rate act oppositely on the two sides, pitch on front and rear."""
        side, row = self.side(wheels), self.row(wheels)
        if covariate in {"roll", "yaw_rate"}:
            return {"opposite sides": side}
        if covariate == "pitch" and np.ptp(row) > 0:
            return {"opposite ends": row - np.mean(row)}
        return {}

    def variants(self) -> Mapping[str, float]:
        """Return the model's optional physics with its neutral values; candidates change them."""
        return {"stiffness_factor": 1.0, "shear_factor": 1.0, "slip_sinkage": 0.0}

    def corrected_tables(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Return the tables with the calibrated gain, cohesion and friction angle."""
        tables = self.tables.model_dump(exclude_none=True)
        drivetrain, soil = tables["drivetrain"], tables["soil"]
        drivetrain["gain_factor"] = [
            before * (values["gain_factor"] + values.get(own_name("gain_factor", wheel), 0.0))
            for wheel, before in enumerate(drivetrain["gain_factor"], 1)
        ]
        soil["cohesion_Pa"] = float(values["cohesion_Pa"])
        soil["friction_angle_deg"] = float(values["friction_angle_deg"])
        return tables

    def absorb_effects(
        self, tables: Mapping[str, Any], effects: Sequence[Contribution]
    ) -> tuple[dict[str, Any], tuple[Contribution, ...]]:
        """Add Coulomb friction and viscous friction of power 1 to `[drivetrain]`, where the daemon reads them."""
        drivetrain = dict(tables["drivetrain"])
        left = tuple(effect for effect in effects if not _absorb(drivetrain, self.tables.drivetrain.ratio, effect))
        return {**tables, "drivetrain": drivetrain}, left

    def stated_effects(self) -> Sequence[Contribution]:
        """Return the friction that `[drivetrain]` has, one for each group of wheels with the same value."""
        drivetrain = self.tables.drivetrain
        coulomb = _stated("coulomb-friction", {}, drivetrain.no_load_current_A, drivetrain.no_load_current_std_A, 1.0)
        viscous = _stated(
            "viscous-friction",
            {"power": 1.0},
            drivetrain.viscous_current_A_s_per_rad,
            drivetrain.viscous_current_std_A_s_per_rad,
            drivetrain.ratio,
        )
        return (*coulomb, *viscous)

    def _place_m(self, inputs: Mapping[str, Array], speed: Array) -> Array:
        """Return how far along the way each wheel is [m]: what the middle has driven, and where the axle stands.

        Ways back count as ways on: whether a rover that reverses meets its own tracks is not recorded.
        """
        hub = np.abs(self.tables.wheel.radius_m * speed * (1 - inputs["slip"]))
        steps = np.clip(np.diff(inputs["t_s"][:, 0], prepend=inputs["t_s"][0, 0]), 0, None)
        driven = np.cumsum(known_mean(hub, axis=1) * np.nan_to_num(steps))
        rows = np.array([0.5, 0.5, 0.0, 0.0, -0.5, -0.5]) if speed.shape[1] == 6 else np.zeros(speed.shape[1])
        return driven[:, None] + rows * self.tables.rover.wheelbase_m

    def _wheel_speed(self, inputs: Mapping[str, Array]) -> Array:
        return inputs["motor_speed_rad_s"] / self.tables.drivetrain.ratio


def _absorb(drivetrain: dict[str, Any], ratio: float, effect: Contribution) -> bool:
    """Add a friction to `[drivetrain]`; return whether there is a key for it."""
    value = effect.coefficients[0]
    if value < 0:
        return False
    if effect.name == "coulomb-friction":
        _add_friction(drivetrain, ("no_load_current_A", "no_load_current_std_A"), value, effect)
        return True
    if effect.name == "viscous-friction" and abs(float(effect.shape["power"]) - 1) < POWER_TOLERANCE:
        # The daemon's viscous term is per motor speed, the effect's per wheel speed.
        names = ("viscous_current_A_s_per_rad", "viscous_current_std_A_s_per_rad")
        _add_friction(drivetrain, names, value / ratio, effect)
        return True
    return False


def _add_friction(drivetrain: dict[str, Any], names: tuple[str, str], value: float, effect: Contribution) -> None:
    """Add a value to the effect's wheels, and its standard deviation in quadrature."""
    on: Array = np.isin(np.arange(1, WHEELS + 1), effect.wheels).astype(np.float64)
    before, std = (np.broadcast_to(np.asarray(drivetrain[name], np.float64), (WHEELS,)) for name in names)
    drivetrain[names[0]] = (before + value * on).tolist()
    drivetrain[names[1]] = np.hypot(std, effect.relative_std * value * on).tolist()


def _stated(
    name: str, shape: Shape, values: Sequence[float], stds: Sequence[float], per_wheel_speed: float
) -> tuple[Contribution, ...]:
    """Return the effects of a friction that is stated for each wheel; wheels without it have none."""
    groups: dict[tuple[float, float], list[int]] = {}
    for wheel, pair in enumerate(zip(values, stds, strict=True), 1):
        if pair[0] > 0:
            groups.setdefault(pair, []).append(wheel)
    return tuple(
        Contribution(name, dict(shape), (value * per_wheel_speed,), tuple(wheels), std / value)
        for (value, std), wheels in groups.items()
    )


def slip_sunk(contact_angle_rad: Array, slip: Array, strength: float) -> Array:
    """Return the contact angle of a wheel that slip has sunk deeper [rad] (Eqs 8 and 9).

    `strength` 1 is Lyasko's z_SS = z (1 + i)/(1 − 0.5 i); 0 leaves the sinkage as it is.
    """
    deeper = 1 + strength * ((1 + slip) / (1 - 0.5 * slip) - 1)
    cosine = 1 - deeper * (1 - np.cos(contact_angle_rad))
    return np.minimum(np.arccos(np.clip(cosine, -1, 1)), LARGEST_CONTACT_ANGLE_RAD)


def _lifted(load_N: Array) -> NDArray[np.bool_]:
    """Return the instants in which no wheel carries anything, shape (time, 1): the rover stands on a block."""
    known = np.isfinite(load_N)
    return np.asarray(known.any(axis=1) & ~np.any(known & (np.abs(load_N) >= LIFTED_N), axis=1))[:, None]


def _mistakes(error: ValidationError) -> SimulationError:
    """Return one error with every mistake; its place is the first one's."""
    places = [tuple(map(str, each["loc"])) for each in error.errors()]
    told = "; ".join(
        f"{'.'.join(place)}: {each['msg']}{_cure(place, each['type'])}"
        for place, each in zip(places, error.errors(), strict=True)
    )
    return SimulationError(f"the simulation's tables are wrong: {told}", places[0])


def _cure(place: tuple[str, ...], kind: str) -> str:
    """Return what a misspelt key or table may have meant."""
    if kind != "extra_forbidden":
        return ""
    fields: Mapping[str, Any] = RoverWheelTables.model_fields
    for name in place[:-1]:
        fields = getattr(fields[name].annotation, "model_fields", {}) if name in fields else {}
    return f"; {did_you_mean(place[-1], fields)}"


def _priors(tables: RoverWheelTables) -> dict[str, Prior]:
    soil = tables.soil
    return {
        "gain_factor": Prior(1.0, tables.drivetrain.gain_relative_std),
        "cohesion_Pa": Prior(soil.cohesion_Pa, soil.cohesion_relative_std * soil.cohesion_Pa, "Pa"),
        "friction_angle_deg": Prior(
            soil.friction_angle_deg, soil.friction_angle_relative_std * soil.friction_angle_deg, "deg"
        ),
    }


def _sensors(errors: Sensors) -> dict[str, SensorError]:
    return {
        "load_N": SensorError(relative=errors.load_relative_std),
        # Slip is 1 − V/(r ω): the ground speed's relative error is slip's absolute one, within a factor (1 − i).
        "slip": SensorError(absolute=errors.ground_speed_relative_std),
        "pitch_rad": SensorError(absolute=errors.pitch_std_rad),
        "roll_rad": SensorError(absolute=errors.roll_std_rad),
        "yaw_rate_rad_s": SensorError(absolute=errors.yaw_rate_std_rad_s),
        "motor_temperature_degC": SensorError(absolute=errors.temperature_std_degC),
    }
