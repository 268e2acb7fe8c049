"""Known messages of LeRobot, the FEETECH SDK, rustypot and python-can: their cause and the code of the finding."""

from __future__ import annotations

import re
from typing import Final

from motorbus.core.findings import Finding

LOOK: Final = "`motorbus doctor BUS` measures it"
MESSAGES: Final[tuple[tuple[str, str, str, str], ...]] = (
    # pattern, code, cause, fix
    (r"No such file or directory: '?(/dev/|COM)|could not open port .*(FileNotFound|No such file)",
     "port-missing", "the adapter is not plugged in, or has another name now", "`motorbus scan` lists the ports"),
    (r"Permission ?(denied|Error).*(/dev/tty|COM\d)|could not open port .*(Permission|Access is denied)",
     "port-permission", "the user may not open the port, or on Windows another program holds it",
     "`sudo usermod -aG dialout $USER`, log in again"),
    (r"Device or resource busy|Port is in use|exclusively lock port|Could not exclusively",
     "port-busy", "another program holds the port", "close it there; `motorbus doctor BUS` names it"),
    (r"termios.error: \(22|Invalid argument.*(baud|rate)|Failed to set (custom )?baud ?rate",
     "rate-refused", "the adapter or its driver does not have this rate", "another adapter, or another driver"),
    (r"readiness to read but returned no data|Input/output error|device disconnected|ClearCommError failed",
     "port-lost", "the adapter was unplugged or lost its supply", "check plug, hub and supply"),
    (r"Magnitude \d+ exceeds \d+|homing_?offset.*(exceed|out of range)",
     "calibration-wrap", "the middle of the travel is too far from the middle of the encoder, or the seam is inside",
     "`motorbus setup calibrate` of this joint"),
    (r"Mismatch between calibration values in the motor and the calibration file|has no calibration registered",
     "calibration-differs", "the servo holds another calibration than the file", "`motorbus setup import FILE`"),
    (r"Input voltage error|RxPacketError.*voltage", "supply-out-of-range",
     "the supply is outside of the limits of the servo, or dips", LOOK),
    (r"Overload error|RxPacketError.*overload|MotorError.*OVERLOAD", "overload-latched",
     "the servo pushed for too long and keeps this alarm", "`motorbus feetech recover-overload DEVICE`"),
    (r"Overheat(ing)? error|RxPacketError.*(heat|temperature)", "too-hot", "the servo is above its limit",
     "switch torque off until it is cool"),
    (r"Missing motor IDs|motor check failed|Motor '?\w+'? \(model .*\) was not found|No motor found",
     "device-missing", "a servo does not answer: its plug, its supply, its id or its rate", LOOK),
    (r"Motors? with (a )?wrong model|model number.*(mismatch|expected)|Expected model",
     "model-unknown", "another model than the program expects", "motorbus takes the model that the servo reports"),
    (r"Some motors use different firmware versions|same firmware", "firmware-mixed",
     "LeRobot refuses an arm with several firmware versions", "motorbus needs no equal versions"),
    (r"Found (several|multiple) motors|more than one motor|two motors.*same id", "duplicate-id",
     "several servos answer, new ones with the factory id", "connect one at a time; `motorbus setup number`"),
    (r"There is no status packet|COMM_RX_TIMEOUT|-3001|MotorTimeout|time.?out.*(servo|motor)|kind: TimedOut",
     "replies-lost", "a servo did not answer in time: a loose plug, a supply that dips, or a wrong id", LOOK),
    (r"Incorrect status packet|COMM_RX_CORRUPT|-3002|ChecksumError|[Cc]hecksum (mismatch|error)|InvalidHeader",
     "line-noise", "replies are damaged: two servos with one id, noise, or an echo", LOOK),
    (r"Port is in use!|COMM_PORT_BUSY|-1000", "port-busy", "two threads or programs use the port", "use one"),
    (r"Failed to (sync_?)?read '?\w+'? on ids|Failed to (sync_?)?write", "replies-lost",
     "one of several servos did not answer", LOOK),
    (r"Error receiving: Network is down|Network is down|ENETDOWN|No such device.*can\d", "port-missing",
     "the CAN interface is not up", "`sudo ip link set can0 up type can bitrate 500000`"),
    (r"No buffer space available|Transmit buffer full|ENOBUFS", "adapter-no-ack",
     "no node acknowledges the frames: no supply, another bit rate, or no termination", LOOK),
    (r"[Bb]us[- ]?off|error[- ]passive|CanOperationError.*ack", "can-wrong-bitrate",
     "frames are destroyed: another bit rate, or no termination", LOOK),
    (r"No SDO response received", "can-silent", "no node with this id, another bit rate, or no termination", LOOK),
    (r"Could not set bitrate|Invalid bitrate|[Bb]itrate .* not (supported|valid)", "rate-refused",
     "the adapter does not have this bit rate", "choose one that it has"),
    (r"brltty", "brltty", "brltty takes CH340 adapters for Braille displays", "`sudo apt remove brltty`"),
    (r"(loop|control).*(slower|is running slow|too slow)|Record loop is running slower", "loop-too-fast",
     "the loop does not reach its rate", "`motorbus doctor BUS --loop RATE`"),
)  # fmt: skip
"""Sources: threads of lerobot (#441 #526 #560 #1010 #1252 #1296), DynamixelSDK, rustypot, python-can (#285 #1746)."""


def explain(text: str) -> list[Finding]:
    """A finding for each known message in a log or traceback, the last one first: it ended the program."""
    found: dict[str, Finding] = {}
    for number, line in reversed(list(enumerate(text.splitlines(), 1))):
        for pattern, code, cause, fix in MESSAGES:
            if re.search(pattern, line, re.IGNORECASE):
                evidence = " ".join(line.split())[:160]
                found.setdefault(code, Finding(code, "error", f"line {number}", evidence, cause, fix))
                break
    return list(found.values())
