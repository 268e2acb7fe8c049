"""motorbus: drive, simulate and diagnose motors on a bus.

The names a user needs are here and are loaded when first used, so that `import motorbus` costs nothing:

    Robot, AsyncRobot   a machine by its file motorbus.toml          motorbus.Robot.load("motorbus.toml")
    open, open_async    a bus by its address, blocking or async     motorbus.open("feetech:/dev/ttyACM0")
    simulate            a simulated bus in this process             motorbus.simulate("feetech", ids="1-6")
    recorder            recordings of a bus, decoded                motorbus.recorder.Decoder("feetech")
    the errors          motorbus.NoReply and all others             see `motorbus.errors`
    the families        motorbus.feetech …                          device classes and driver functions
"""

TYPE_CHECKING = False  # `typing` takes longer to import than all of this
if TYPE_CHECKING:
    from typing import Any

    from motorbus import recorder
    from motorbus.errors import (
        AnotherAdapter,
        ChecksumError,
        DeviceError,
        Faulted,
        FramingError,
        Interrupted,
        LimitExceeded,
        LinkError,
        LinkFull,
        LinkLost,
        MotionError,
        MotorbusError,
        NoReply,
        NotHomed,
        OutcomeUnknown,
        Overloaded,
        PortBusy,
        PortNotFound,
        Refused,
        RequestError,
        Stalled,
        UnexpectedReply,
        VerificationFailed,
        WireError,
    )
    from motorbus.families import feetech, kst, stepper
    from motorbus.motion.robot import AsyncRobot, Robot
    from motorbus.session import open, open_async, simulate

__version__ = "0.1.0"

__all__ = [
    "AnotherAdapter",
    "AsyncRobot",
    "ChecksumError",
    "DeviceError",
    "Faulted",
    "FramingError",
    "Interrupted",
    "LimitExceeded",
    "LinkError",
    "LinkFull",
    "LinkLost",
    "MotionError",
    "MotorbusError",
    "NoReply",
    "NotHomed",
    "OutcomeUnknown",
    "Overloaded",
    "PortBusy",
    "PortNotFound",
    "Refused",
    "RequestError",
    "Robot",
    "Stalled",
    "UnexpectedReply",
    "VerificationFailed",
    "WireError",
    "feetech",
    "kst",
    "open",
    "open_async",
    "recorder",
    "simulate",
    "stepper",
]

_LAZY = {
    "AsyncRobot": "motorbus.motion.robot",
    "Robot": "motorbus.motion.robot",
    "open": "motorbus.session",
    "open_async": "motorbus.session",
    "simulate": "motorbus.session",
}


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> "Any":
    from importlib import import_module

    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    if name == "recorder":
        return import_module("motorbus.recorder")
    if name.startswith("_"):
        raise AttributeError(name)
    if name in __all__ and name[0].isupper():
        return getattr(import_module("motorbus.errors"), name)
    try:
        return import_module(f"motorbus.families.{name}")
    except ModuleNotFoundError as error:
        if error.name != f"motorbus.families.{name}":
            raise
        raise AttributeError(f"module 'motorbus' has no attribute {name!r}") from None
