"""Follower and leader of LeRobot.

`connect` reads before it gives torque: an arm whose homing offsets belong to another calibration is refused.
`disconnect` may be called at any time, stops before it releases, and never raises.
"""

from __future__ import annotations

import logging
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

from lerobot.cameras.utils import make_cameras_from_configs
from lerobot.motors import MotorCalibration
from lerobot.robots.robot import Robot
from lerobot.teleoperators.teleoperator import Teleoperator

import motorbus
from motorbus.bus.blocking import Bus
from motorbus.errors import MotorbusError, Refused, RequestError
from motorbus.families import feetech
from motorbus.lerobot.config import MotorbusFollowerConfig, MotorbusLeaderConfig
from motorbus.lerobot.units import JointUnit, machine_of, unit_of
from motorbus.motion.blocks import Loop
from motorbus.setup import lerobot as files
from motorbus.setup.calibrate import JointCalibration, apply, calibrate, offset_of
from motorbus.setup.engine import ask, run
from motorbus.setup.number import number
from motorbus.setup.presets import Preset, preset
from motorbus.setup.terminal import Terminal

LOG: Final = logging.getLogger("motorbus.lerobot")
LOOP_RATE: Final = 60.0  # Hz; actions that come slower are followed in up to three steps
LONGEST: Final = 0.05  # s between two actions; after a pause the arm moves as if it had been so long


class Arm:
    """The bus of an arm before it is calibrated, and its control loop afterwards."""

    def __init__(self, port: str, preset_name: str) -> None:
        self.address: Final = port if ":" in port else f"feetech:{port}"
        self.preset: Final[Preset] = preset(preset_name)
        self.bus: Bus | None = None
        self.robot: motorbus.Robot | None = None
        self.loop: Loop | None = None
        self._stack = ExitStack()

    @property
    def is_open(self) -> bool:
        """The port is held."""
        return self.bus is not None or self.robot is not None

    def open_bus(self) -> Bus:
        """Open the bus alone. Reads and writes nothing."""
        if self.is_open:
            raise RequestError(f"{self.address} is connected already", advice="disconnect() first")
        self.bus = motorbus.open(self.address)
        return self.bus

    def require_bus(self) -> Bus:
        """The bus. Raises RequestError unless it is open and no loop runs."""
        if self.bus is None:
            raise RequestError(f"{self.address} is not connected", advice="connect(calibrate=False)")
        return self.bus

    def start(self, calibration: dict[str, JointCalibration], *, max_velocity: float, exit: str) -> Loop:
        """Hand the port over to a robot with a control loop. No torque yet."""
        self.require_bus().close()
        self.bus = None
        config = machine_of(self.address, self.preset, calibration, max_velocity=max_velocity, exit=exit)
        self.robot = self._stack.enter_context(motorbus.Robot(config))
        self.loop = self._stack.enter_context(self.robot.loop(LOOP_RATE, policy="clamp"))
        return self.loop

    def close(self) -> None:
        """Stop, leave each joint as `exit` says, give the port back. Never raises."""
        robot, stack = self.robot, self._stack
        bus, self.bus, self.robot, self.loop, self._stack = self.bus, None, None, None, ExitStack()
        try:
            if bus is not None:
                bus.close()
            stack.close()
        except Exception as error:
            joints = ", ".join(robot.axes) if robot is not None else self.address
            LOG.error("%s: TORQUE MAY STILL BE ON: %s", joints, error)


class _Device:
    """What follower and leader share."""

    config: Any
    calibration: dict[str, MotorCalibration]
    calibration_dir: Path
    calibration_fpath: Path
    id: str | None
    _arm: Arm
    _units: dict[str, JointUnit]

    @property
    def is_connected(self) -> bool:
        """The port is open."""
        return self._arm.is_open

    @property
    def is_calibrated(self) -> bool:
        """The file has all joints, and the servos hold the same homing offsets where the bus is open."""
        known = self._calibration()
        if set(known) != {joint.name for joint in self._arm.preset.joints}:
            return False
        return self._arm.bus is None or not files.differences(self._offsets(), known)

    @property
    def joints(self) -> dict[str, type]:
        """The features of the joints."""
        return {f"{joint.name}.pos": float for joint in self._arm.preset.joints}

    def configure(self) -> None:
        """Nothing: `setup_motors` writes the settings, once."""

    def setup_motors(self) -> None:
        """Number the servos, one on the bus at a time."""
        own = not self._arm.is_open
        bus = self._arm.open_bus() if own else self._arm.require_bus()
        try:
            run(number(bus, self._arm.preset), Terminal())
        finally:
            if own:
                self._arm.close()

    def calibrate(self) -> None:
        """Write the calibration file to the servos, or sweep the joints by hand; asks which."""
        bus, face = self._arm.require_bus(), Terminal()
        known = self._calibration()
        if (
            known
            and run(ask(f"{self.calibration_fpath} has a calibration", "use it", "calibrate"), face)
            == "use it"
        ):
            for one in known.values():
                apply(bus, one)
            return
        found = run(calibrate(bus, self._arm.preset), face)
        self.calibration = {
            name: MotorCalibration(one.id, one.drive_mode, one.homing_offset, one.range_min, one.range_max)
            for name, one in found.items()
        }
        self._save_calibration()  # type: ignore[attr-defined]

    def _calibration(self) -> dict[str, JointCalibration]:
        return {
            name: JointCalibration(one.id, one.drive_mode, one.homing_offset, one.range_min, one.range_max)
            for name, one in self.calibration.items()
        }

    def _offsets(self) -> dict[str, int]:
        bus = self._arm.require_bus()
        return {joint.name: offset_of(bus, joint) for joint in self._arm.preset.joints}

    def _connect(self, *, calibrate: bool, max_velocity: float, exit: str) -> None:
        """Open, compare the servos with the calibration, start the loop if there is one."""
        bus = self._arm.open_bus()
        try:
            for joint in self._arm.preset.joints:
                feetech.Servo(bus, joint.id).prepare()
            if calibrate and not self.is_calibrated:
                self._refuse_another_arm()
                self.calibrate()
            if calibrate:
                known = self._calibration()
                self._units = {
                    name: unit_of(name, one, use_degrees=self.config.use_degrees)
                    for name, one in known.items()
                }
                self._arm.start(known, max_velocity=max_velocity, exit=exit)
        except BaseException:
            self._arm.close()
            raise

    def _refuse_another_arm(self) -> None:
        """Raise Refused if the offsets in the servos are those of another calibration file."""
        others = {}
        for path in self.calibration_dir.parent.rglob("*.json"):
            if path != self.calibration_fpath:
                try:
                    others[f"{path.parent.name}/{path.stem}"] = files.load(path)
                except MotorbusError:
                    continue
        if name := files.owner(self._offsets(), others):
            raise Refused(
                f"{self._arm.address} is the arm of the calibration {name}, not {self.id}",
                advice="exchange the two ports, or give the right --id",
            )

    def _read(self) -> dict[str, float]:
        positions = self._loop().read()
        return {f"{name}.pos": unit.value(positions[name]) for name, unit in self._units.items()}

    def _loop(self) -> Loop:
        if self._arm.loop is None:
            raise RequestError(f"{self._arm.address} is not connected", advice="connect() it")
        return self._arm.loop

    def _close(self) -> None:
        self._arm.close()


class MotorbusFollower(_Device, Robot):
    """A follower arm: `--robot.type=motorbus_follower`."""

    config_class = MotorbusFollowerConfig
    name = "motorbus_follower"

    def __init__(self, config: MotorbusFollowerConfig) -> None:
        self._arm = Arm(config.port, config.preset)  # first: `__del__` of the base class asks for it
        self._units = {}
        self._steps: dict[str, float] = {}
        self._sent_at = 0.0
        super().__init__(config)
        self.config = config
        self.cameras = make_cameras_from_configs(config.cameras)

    @property
    def observation_features(self) -> dict[str, Any]:
        """Joints and cameras."""
        cameras = {name: (one.height, one.width, 3) for name, one in self.config.cameras.items()}
        return {**self.joints, **cameras}

    @property
    def action_features(self) -> dict[str, Any]:
        """Joints."""
        return self.joints

    def connect(self, calibrate: bool = True) -> None:
        """Open the arm and its cameras; the first action gives torque. See `_Device`."""
        exit = "torque_off" if self.config.disable_torque_on_disconnect else "hold"
        self._connect(calibrate=calibrate, max_velocity=self.config.max_velocity, exit=exit)
        self._steps = self._relative_targets()
        try:
            for camera in self.cameras.values():
                camera.connect()
        except BaseException:
            self.disconnect()
            raise

    def _relative_targets(self) -> dict[str, float]:
        given = self.config.max_relative_target
        if given is None:
            return {}
        names = [joint.name for joint in self._arm.preset.joints]
        return (
            {name: float(given[name]) for name in given}
            if isinstance(given, dict)
            else dict.fromkeys(names, float(given))
        )

    def get_observation(self) -> dict[str, Any]:
        """Positions of all joints, and the latest picture of each camera.

        A joint that misses a reading keeps its last one for 0.3 s. Raises NoReply with its name after that.
        """
        observation: dict[str, Any] = self._read()
        for name, camera in self.cameras.items():
            observation[name] = camera.async_read()
        return observation

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Send goals, within the calibrated range, the velocity and `max_relative_target`; gives what was sent."""
        loop, units = self._loop(), self._units
        here = loop.read() if self._steps else {}
        targets = {}
        for key, value in action.items():
            name = key.removesuffix(".pos")
            if name not in units:
                continue
            unit = units[name]
            if (most := self._steps.get(name)) is not None:
                present = unit.value(here[name])
                value = min(max(value, present - most), present + most)
            targets[name] = unit.position(value)
        now = time.monotonic()
        elapsed, self._sent_at = min(now - self._sent_at, LONGEST), now
        sent = loop.write(targets, elapsed)
        return {f"{name}.pos": units[name].value(sent[name]) for name in targets}

    def disconnect(self) -> None:
        """Stop, release or hold as configured, close everything. Never raises; may be called again."""
        for name, camera in self.cameras.items():
            try:
                if camera.is_connected:
                    camera.disconnect()
            except Exception as error:
                LOG.error("camera %s: %s", name, error)
        self._close()


class MotorbusLeader(_Device, Teleoperator):
    """A leader arm: `--teleop.type=motorbus_leader`. It stays limp."""

    config_class = MotorbusLeaderConfig
    name = "motorbus_leader"

    def __init__(self, config: MotorbusLeaderConfig) -> None:
        self._arm = Arm(config.port, config.preset)
        self._units = {}
        super().__init__(config)
        self.config = config

    @property
    def action_features(self) -> dict[str, type]:
        """Joints."""
        return self.joints

    @property
    def feedback_features(self) -> dict[str, type]:
        """None."""
        return {}

    def connect(self, calibrate: bool = True) -> None:
        """Open the arm and switch its torque off."""
        self._connect(calibrate=calibrate, max_velocity=720.0, exit="leave")
        if self._arm.robot is not None:
            self._arm.robot.disable_torque()

    def get_action(self) -> dict[str, float]:
        """Positions of all joints."""
        return self._read()

    def send_feedback(self, feedback: dict[str, float]) -> None:
        """Nothing: the leader has no feedback."""

    def disconnect(self) -> None:
        """Close the port. Never raises; may be called again."""
        self._close()
