"""Known messages of LeRobot, the FEETECH SDK, rustypot and python-can, and the codes of their causes."""

from __future__ import annotations

import re
from typing import Final

from motorbus.core.findings import Finding
from motorbus.doctor.findings import complete

LOOK: Final = "`motorbus doctor BUS` measures it"
# fmt: off
MESSAGES: Final = (
    (r"Network is down|ENETDOWN|No such device.*can\d|No such file or directory: '?(/dev/|COM)", "port-missing"),
    (r"could not open port .*(FileNotFound|No such file)", "port-missing"),
    (r"Permission ?(denied|Error).*(/dev/tty|COM\d)|could not open port .*(Permission|denied)", "port-permission"),
    (r"Device or resource busy|Port is in use|exclusively lock port|COMM_PORT_BUSY|-1000\b", "port-busy"),
    (r"termios.error: \(22|Invalid argument.*(baud|rate)|Failed to set (custom )?baud ?rate", "rate-refused"),
    (r"Could not set bitrate|Invalid (data )?bitrate|bitrate .* not (supported|valid)", "rate-refused"),
    (r"returned no data|Input/output error|device disconnected|ClearCommError failed", "port-lost"),
    (r"Magnitude \d+ exceeds \d+|homing_?offset.*(exceed|out of range)", "calibration-wrap"),
    (r"Mismatch between calibration values|has no calibration registered", "calibration-differs"),
    (r"Input voltage error|voltage (error|alarm)|RxPacketError.*voltage", "supply-out-of-range"),
    (r"Overload error|RxPacketError.*overload|MotorError.*overload", "overload-latched"),
    (r"Overheat(ing)? error|RxPacketError.*(heat|temperature)", "too-hot"),
    (r"Missing motor IDs|motor check failed|Motor '?\w+'? .*not found|No motor found", "device-missing"),
    (r"Motors? with (a )?wrong model|model number.*(mismatch|expected)|Expected model", "model-unknown"),
    (r"different firmware versions|same firmware", "firmware-mixed"),
    (r"Found (several|multiple) motors|more than one motor|motors.*same id", "duplicate-id"),
    (r"no status packet|COMM_RX_TIMEOUT|-3001\b|time.?out.*(servo|motor)|kind: TimedOut", "replies-lost"),
    (r"Incorrect status packet|COMM_RX_CORRUPT|-3002\b|checksum ?(mismatch|error)|InvalidHeader", "line-noise"),
    (r"Failed to (sync_?)?(read|write)", "replies-lost"),
    (r"No buffer space available|Transmit buffer full|ENOBUFS", "adapter-no-ack"),
    (r"bus[- ]?off|error[- ]passive|CanOperationError.*ack", "can-wrong-bitrate"),
    (r"No SDO response received", "can-silent"),
    (r"(loop|control).*(running slow|too slow)", "loop-too-fast"),
    (r"brltty", "brltty"),
)
# fmt: on
"""Sources: threads of lerobot (#441 #526 #560 #1010 #1252 #1296), DynamixelSDK, rustypot, python-can (#285 #1746)."""


def explain(text: str) -> list[Finding]:
    """A finding for each known message in a log or traceback, the last one first: it ended the program."""
    found: dict[str, Finding] = {}
    for number, line in reversed(list(enumerate(text.splitlines(), 1))):
        code = next((code for pattern, code in MESSAGES if re.search(pattern, line, re.IGNORECASE)), "")
        if code and code not in found:
            evidence = " ".join(line.split())[:160]
            found[code] = complete(Finding(code, f"line {number}", evidence), "BUS")
    return list(found.values())
