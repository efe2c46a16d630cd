"""The five machines: the true physics of each, and what may be concealed in it."""

from regolithd.calibration.validation.machine_trials.machines.agv_drive import AGV_DRIVE
from regolithd.calibration.validation.machine_trials.machines.oven import OVEN
from regolithd.calibration.validation.machine_trials.machines.propeller_stand import PROPELLER_STAND
from regolithd.calibration.validation.machine_trials.machines.servo_joint import SERVO_JOINT
from regolithd.calibration.validation.machine_trials.machines.two_tanks import TWO_TANKS

MACHINES = {machine.name: machine for machine in (SERVO_JOINT, AGV_DRIVE, PROPELLER_STAND, TWO_TANKS, OVEN)}

__all__ = ["MACHINES"]
