"""Simulated world of the virtual rover: six driven wheels on soil, and the readings of its sensors.

    motor speed ▸ wheel speed ▸ slip ─┐
    slope ▸ loads ────────────────────┴▸ soil under the wheel ▸ torque (Eqs 1, 6, 7) ▸ current (Eq. 11 inverted) ▸ noise

It implements the `Plant` of `drivers.virtual`. `truth` holds what no sensor measures: the soil under each wheel and the
true load, slip and torque.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regolithd.calibration.drivetrain.torque import motor_current
from regolithd.calibration.parameters import GRAVITY_M_S2
from regolithd.calibration.terrain.wheel_loads import wheel_loads
from regolithd.calibration.terrain.wheel_soil import contact_angle, wheel_torque
from regolithd.daemon.simulator.scenario import Scenario
from regolithd.daemon.simulator.spatial_noise import CorrelatedNoise, MomentaryDrops
from regolithd.drivers.virtual.plant import WHEELS, Array, Measurement

STANDSTILL_RAD_S = 0.05
"""Below this wheel speed the wheel–soil model is undefined; torque and slip are faded to 0."""
STALL_CURRENT_A = 1.0  # current of a wheel that has sunk to its axle: the current limit of the EPOS 24/1
WARMING_degC_per_A = 120.0  # steady-state temperature rise of motor and gears above ambient
WARMING_TIME_S = 600.0
SUPPLY_V, SUPPLY_OHM = 24.6, 0.8
SENSOR_CORRELATION_S = 0.05  # of the sensor noise: white at sampling rates below 20 Hz
SKID_STEERING = 0.6  # fraction of the speed difference between the sides that becomes yaw rate; the rest is slip

AHEAD = np.array([1, 1, 0, 0, -1, -1]) / 2  # position ahead of the middle axle, in wheelbases; wheels 1–6
RIGHT = np.array([-1, 1, -1, 1, -1, 1]) / 2  # position right of the centre line, in track widths


@dataclass(frozen=True, slots=True, eq=False)
class GroundTruth:
    """True state at one instant; arrays of shape (6,), SI units. `soils`: name of the soil under each wheel."""

    time_s: float
    distance_m: float
    soils: tuple[str, ...]
    cohesion_Pa: Array
    friction_angle_rad: Array
    load_N: Array
    slip: Array
    torque_Nm: Array


class VirtualWorld:
    """Moves the rover according to its motor speeds; deterministic: same scenario and same calls give the same numbers.

    Attributes
    ----------
    truth
        Ground truth of the last `measure`; None before the first.
    changes
        Ground truth at the start and at each change of soil under any wheel.
    """

    def __init__(self, scenario: Scenario | None = None) -> None:
        self.scenario = scenario = scenario or Scenario()
        terrain, load, current, drops, slow, white = np.random.SeedSequence(scenario.seed).spawn(6)
        noise = scenario.noise
        self._terrain = CorrelatedNoise(terrain, WHEELS + 1, noise.terrain_length_m, keeps=True)
        self._load = CorrelatedNoise(load, WHEELS, SENSOR_CORRELATION_S)
        self._current = CorrelatedNoise(current, WHEELS, noise.current_correlation_s)
        self._drops = MomentaryDrops(drops, WHEELS, noise.drops_per_s, noise.drop_duration_s)
        self._sensors = CorrelatedNoise(slow, 5 + WHEELS, SENSOR_CORRELATION_S)
        self._wave_phase = np.random.Generator(np.random.PCG64(white)).uniform(0, 2 * np.pi, 2)
        self._names = tuple(stretch.name for stretch in scenario.ground.stretches)
        self._ends = [stretch.until_m for stretch in scenario.ground.stretches if stretch.until_m is not None]
        self._time_s = 0.0
        self._wheel_angle = np.zeros(WHEELS)
        self._temperature = np.full(WHEELS, scenario.ambient_degC)
        self._distance_m = 0.0
        self._speed_m_s = 0.0
        self._given_load_N = np.full(WHEELS, np.nan)
        self.truth: GroundTruth | None = None
        self.changes: list[GroundTruth] = []

    def follow_loads(self, load_N: Array) -> None:
        """Take these loads [N], shape (6,), as the true ones from now on; NaN: the scenario's."""
        self._given_load_N = load_N

    def measure(self, time_s: float, motor_speed_rad_s: Array) -> Measurement:
        """Advance to `time_s` and return the sensors' readings (see `drivers.virtual.plant.Plant`).

        `motor_speed_rad_s` has shape (6,).
        """
        scenario, noise = self.scenario, self.scenario.noise
        elapsed_s, self._time_s = time_s - self._time_s, time_s
        wheel_speed = motor_speed_rad_s / scenario.drivetrain.ratio
        self._distance_m += self._speed_m_s * elapsed_s
        self._wheel_angle = self._wheel_angle + wheel_speed * elapsed_s
        terrain = self._terrain.at(abs(self._distance_m))
        pitch, roll = self._slope()
        self._speed_m_s, yaw_rate, hub_speed = self._motion(wheel_speed, pitch, float(terrain[-1]))
        slip = self._slip(wheel_speed, hub_speed)
        load_std = np.array(noise.load_relative_std)
        level = wheel_loads(np.array(pitch), np.array(roll), scenario.rover, scenario.motion.centre_of_mass_m)
        load = level * (1 + load_std * np.sqrt(noise.terrain_share) * terrain[:-1])
        load = np.where(np.isfinite(self._given_load_N), self._given_load_N, load)
        torque, numbers = self._torque(np.maximum(load, 0.1), slip, wheel_speed, pitch)
        self._update_truth(numbers, load, slip, torque)
        steady = self._steady_current(torque, motor_speed_rad_s)
        current = self._noisy_current(steady)
        self._warm(steady, elapsed_s)
        sensed = self._sensors.at(time_s)
        angle_std, yaw_std = np.radians(noise.angle_std_deg), np.radians(noise.yaw_rate_std_deg_s)
        speed_factor = 1 + noise.ground_speed_relative_std * float(sensed[3])
        return Measurement(
            motor_current_A=current + noise.current_std_A * sensed[5:],
            load_N=load * (1 + load_std * np.sqrt(1 - noise.terrain_share) * self._load.at(time_s))
            + self._load_drift(),
            motor_temperature_degC=self._temperature,
            bus_voltage_V=SUPPLY_V - SUPPLY_OHM * float(np.sum(np.abs(current))),
            pitch_rad=float(pitch + angle_std * sensed[0]),
            roll_rad=float(roll + angle_std * sensed[1]),
            yaw_rate_rad_s=float(yaw_rate + yaw_std * sensed[2]),
            ground_speed_m_s=self._speed_m_s * speed_factor,
            hub_speed_m_s=hub_speed * speed_factor,
        )

    def _slope(self) -> tuple[float, float]:
        """Return pitch and roll [rad] at the present distance."""
        ground = self.scenario.ground
        phase = 2 * np.pi * self._distance_m / ground.wave_length_m
        pitch, roll = np.radians([ground.pitch_deg, ground.roll_deg]) + np.radians(ground.wave_deg) * np.sin(
            np.array([phase, phase / 2]) + self._wave_phase
        )
        return float(pitch), float(roll)

    def _motion(self, wheel_speed: Array, pitch_rad: float, slip_noise: float) -> tuple[float, float, Array]:
        """Return speed over ground [m/s], yaw rate [rad/s] and each hub's speed [m/s]."""
        motion, rover, radius = self.scenario.motion, self.scenario.rover, self.scenario.wheel.radius_m
        slip = motion.slip + motion.slip_per_grade * np.sin(pitch_rad) + self.scenario.noise.slip_std * slip_noise
        if not np.any(np.abs(wheel_speed) > 0):
            return 0.0, 0.0, np.zeros(WHEELS)
        rim = radius * wheel_speed
        speed = float(np.mean(rim) * (1 - slip))
        yaw_rate = SKID_STEERING * float(np.mean(rim[RIGHT > 0]) - np.mean(rim[RIGHT < 0])) / rover.track_m
        return speed, yaw_rate, speed + yaw_rate * rover.track_m * RIGHT

    def _slip(self, wheel_speed: Array, hub_speed: Array) -> Array:
        """Return each wheel's slip, i = 1 − V/(r ω); 0 at standstill, where it is undefined."""
        rim = self.scenario.wheel.radius_m * wheel_speed
        turning = np.abs(wheel_speed) >= STANDSTILL_RAD_S
        ratio = np.divide(hub_speed, rim, out=np.ones(WHEELS), where=turning)
        return np.clip(1 - ratio, -0.9, 0.9)

    def _torque(self, load_N: Array, slip: Array, wheel_speed: Array, pitch_rad: float) -> tuple[Array, list[int]]:
        """Return each wheel's torque [N·m], signed like its speed, and the index of the stretch under it."""
        scenario = self.scenario
        numbers = [self._stretch(self._distance_m + ahead * scenario.rover.wheelbase_m) for ahead in AHEAD]
        torque = np.full(WHEELS, np.nan)
        for number in sorted(set(numbers)):
            there, stretch = np.array(numbers) == number, scenario.ground.stretches[number]
            angle = contact_angle(load_N[there], slip[there], scenario.wheel, stretch.soil)
            torque[there] = wheel_torque(angle, slip[there], scenario.wheel, stretch.soil)
        stalled = STALL_CURRENT_A * scenario.drivetrain.gain_Nm_per_A
        torque = np.where(np.isnan(torque), stalled, torque)
        weight = scenario.rover.mass_kg * GRAVITY_M_S2
        grade = scenario.hidden.grade_resistance * weight * np.sin(pitch_rad) * scenario.wheel.radius_m / WHEELS
        fading = np.clip(wheel_speed / STANDSTILL_RAD_S, -1, 1)
        return torque * fading + grade * np.abs(fading), numbers

    def _stretch(self, place_m: float) -> int:
        return int(np.searchsorted(self._ends, place_m, side="right"))

    def _steady_current(self, torque_Nm: Array, motor_speed_rad_s: Array) -> Array:
        """Return the motors' currents [A] without noise: Eq. 11 inverted, plus the hidden effects."""
        hidden, direction = self.scenario.hidden, np.sign(motor_speed_rad_s)
        magnet = 1 + hidden.torque_constant_per_degC * (self._temperature - 20)
        current = motor_current(torque_Nm / magnet, motor_speed_rad_s, self.scenario.drivetrain)
        current += direction * hidden.cold_drag_A * np.exp(-self._temperature / 10)
        current += direction * hidden.ripple_A * np.sin(hidden.ripple_order * self._wheel_angle)
        bearing = hidden.bearing_drag
        if bearing is not None and self._time_s >= bearing.from_s:
            current[bearing.wheel - 1] += direction[bearing.wheel - 1] * bearing.current_A
        return current

    def _noisy_current(self, steady_A: Array) -> Array:
        """Return the currents [A] with drops and correlated noise; the total standard deviation is Table 4's."""
        noise = self.scenario.noise
        dropping = noise.drops_per_s * noise.drop_duration_s / (1 + noise.drops_per_s * noise.drop_duration_s)
        by_drops = noise.drop_depth * np.sqrt(dropping * (1 - dropping))
        # Relative sensitivity of the current to the load: 1.5 in the soil's part, which is a quarter of the current.
        by_load = 0.4 * np.array(noise.load_relative_std) * np.sqrt(noise.terrain_share)
        rest = np.sqrt(np.maximum(np.array(noise.current_relative_std) ** 2 - by_drops**2 - by_load**2, 0))
        fluctuating = 1 + rest * self._current.at(self._time_s)
        return steady_A * fluctuating * (1 - noise.drop_depth * self._drops.at(self._time_s))

    def _warm(self, current_A: Array, elapsed_s: float) -> None:
        goal = self.scenario.ambient_degC + WARMING_degC_per_A * np.abs(current_A)
        self._temperature = goal + (self._temperature - goal) * np.exp(-elapsed_s / WARMING_TIME_S)

    def _load_drift(self) -> Array:
        drift = np.zeros(WHEELS)
        if (cell := self.scenario.hidden.load_drift) is not None:
            drift[cell.wheel - 1] = cell.newton_per_s * self._time_s
        return drift

    def _update_truth(self, numbers: list[int], load_N: Array, slip: Array, torque_Nm: Array) -> None:
        names = tuple(self._names[number] for number in numbers)
        soils = [self.scenario.ground.stretches[number].soil for number in numbers]
        self.truth = GroundTruth(
            time_s=self._time_s,
            distance_m=self._distance_m,
            soils=names,
            cohesion_Pa=np.array([soil.cohesion_Pa for soil in soils]),
            friction_angle_rad=np.radians([soil.friction_angle_deg for soil in soils]),
            load_N=load_N,
            slip=slip,
            torque_Nm=torque_Nm,
        )
        if not self.changes or self.changes[-1].soils != names:
            self.changes.append(self.truth)
