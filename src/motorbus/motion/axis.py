"""The verbs of an axis, in one list: `Axis` and `AsyncAxis` are two-line classes over it.

Each is a driver function of an axis, and is there on an axis whose device has the capability that it needs.
"""

from __future__ import annotations

from motorbus.core.device import AsyncDevice, BlockingDevice
from motorbus.motion import capabilities as axis
from motorbus.motion import reckoning
from motorbus.motion.capabilities import AxisVerbs, ability
from motorbus.motion.moving import jogging
from motorbus.motion.moving import verbs as moving
from motorbus.motion.safety import standstill


class _Verbs(AxisVerbs):
    state = ability("state", axis.state)
    position = ability("position", axis.position)
    velocity = ability("velocity", axis.velocity)
    load = ability("load", axis.load)
    current = ability("current", axis.current)
    voltage = ability("voltage", axis.voltage)
    temperature = ability("temperature", axis.temperature)
    enable_torque = ability("enable_torque", axis.enable_torque)
    disable_torque = ability("disable_torque", axis.disable_torque)
    stop = ability("stop", axis.stop)
    stopped = ability("stop", standstill.stopped)
    hold = ability(("enable_torque", "stop"), axis.hold)
    move = ability(("stream", "keep_time"), moving.move_axis)
    move_by = ability(("stream", "move_by"), moving.move_by)
    jog = ability(("stream", "jog"), jogging.jog)
    home = ability("home", reckoning.home)
    run = ability("run", reckoning.run)


class Axis(_Verbs, BlockingDevice):
    """An axis of a `Robot`."""


class AsyncAxis(_Verbs, AsyncDevice):
    """An axis of an `AsyncRobot`: every verb is awaited."""
