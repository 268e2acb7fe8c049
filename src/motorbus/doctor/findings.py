"""The codes of findings in the order of the chain, the report of an examination, and the order of its findings."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Final, NamedTuple

from msgspec import Meta, Struct, structs

from motorbus.core.findings import Finding, Severity


class Code(NamedTuple):
    """The part of the chain, the usual severity, cause and fix of a code; {where} is the device, {bus} its bus."""

    part: str
    severity: Severity
    cause: str
    action: str


# fmt: off
_TABLE: Final[dict[str, tuple[tuple[str, Severity, str, str], ...]]] = {
    "host": (
        ("port-missing", "error", "the adapter is not plugged in, or has another name now",
         "`motorbus scan` lists the ports"),
        ("port-permission", "error", "this user may not open the port",
         "`sudo usermod -aG dialout $USER`, log in again"),
        ("port-busy", "error", "another program holds the port", "close it there: a bus has one owner at a time"),
        ("brltty", "error", "brltty takes CH340 adapters for Braille displays",
         "`sudo apt remove brltty`, plug the adapter in again"),
        ("rate-refused", "error", "the adapter or its driver does not have this rate", "use another adapter"),
        ("port-refused", "error", "the system refuses the port", "plug the adapter in again"),
        ("port-lost", "error", "a loose plug, a hub without supply, or a supply that dips",
         "check plug, hub and supply of the adapter"),
    ),
    "adapter": (
        ("adapter-menu", "error", "the board prints text: an ESP32 in its menu, or a log",
         "put the board into its serial forwarding mode"),
        ("adapter-echo", "warning", "RX and TX are joined; motorbus removes the echo, LeRobot and the SDK do not",
         "set the jumper of the board, or use this adapter with motorbus only"),
        ("adapter-no-ack", "error", "no powered node, another bit rate, no termination, CAN-H and CAN-L swapped",
         "check supply and wiring; 60 ohm between CAN-H and CAN-L"),
        ("latency-timer", "warning", "the latency timer of the adapter (FTDI: 16 ms), a USB hub, or a network",
         "set the latency timer to 1 ms, connect the adapter without a hub"),
    ),
    "power": (
        ("supply-out-of-range", "error", "a weak or wrong supply, as 12 V for a 7.4 V servo, or a long cable",
         "use a supply within the limits of the servo"),
        ("supply-sag", "error", "the supply dips while servos push", "use a supply with more current"),
    ),
    "chain": (
        ("bus-silent", "error", "no supply, or the data line is not connected",
         "check the supply and the cable to the first device"),
        ("can-silent", "error", "no supply, no termination, a cable, or an adapter that is not on this bus",
         "check supply, CAN-H, CAN-L, two resistors of 120 ohm; 29-bit identifiers need id_format=ext"),
        ("wrong-rate", "error", "the device is set to another rate", "open the bus with this baud"),
        ("can-wrong-bitrate", "error", "the devices are set to another bit rate", "open the bus with this bitrate"),
        ("can-mute-node", "error", "a node sends and answers no read: it speaks another protocol",
         "look at the frames with `motorbus monitor {bus} --listen`"),
        ("stepper-foreign", "error", "another device, another rate, or another byte order",
         "check which device is on this line"),
        ("device-missing", "error", "its plug, its supply, or it has another id",
         "plug it in again, then `motorbus scan`"),
        ("line-noise", "error", "a long cable, a missing ground or termination, or another program on the bus",
         "shorten the cable, connect the grounds; CAN: 60 ohm between CAN-H and CAN-L; close other programs"),
        ("replies-lost", "error", "a loose plug, a supply that dips, or an adapter that is too slow",
         "plug the cables in again; then check the supply under load"),
    ),
    "ids": (
        ("duplicate-id", "error", "two devices have this id and answer at once; new ones share the factory id",
         "connect one of them alone, then `motorbus set-id {where} NEW`"),
        ("factory-id", "warning", "a new device is connected beside the others", "`motorbus set-id {where} NEW`"),
        ("can-id-pending", "warning", "a new id was written; it counts after a save and a power cycle",
         "cut its supply for a moment, then run the doctor again"),
        ("device-unnamed", "info", "the machine file has no axis for it", "add an axis to the machine file"),
    ),
    "model": (
        ("model-unknown", "error", "no source describes it; the doctor reads what is common to all",
         "use a known model; `motorbus info {where}` shows what it says of itself"),
        ("firmware-mixed", "warning", "one model with several firmware versions; LeRobot refuses such an arm",
         "use motorbus, or update them with the tool of the maker"),
    ),
    "settings": (
        ("change-unfinished", "error", "the program or the supply ended while it changed the device",
         "`motorbus recover {bus}`"),
        ("overload-latched", "error", "it was overloaded for too long and pushes with its protective torque only",
         "free the joint, then `motorbus feetech recover-overload {where}`"),
        ("too-hot", "error", "it held or pushed for too long", "switch its torque off until it is cool"),
        ("alarm", "error", "the device reports it", "cut its supply for a moment"),
        ("load-high", "warning", "its goal is beyond an obstacle, or the load is too heavy",
         "move the goal back, or write a lower max_torque"),
        ("mode-differs", "error", "another program has changed its operating mode",
         "`motorbus feetech mode {where} MODE`, or change kind of the axis"),
        ("calibration-other", "error", "it was calibrated again, or a servo was replaced",
         "`motorbus setup export` saves the present calibration"),
        ("calibration-wrap", "error", "the seam of the encoder lies inside the travel, or the offset is a foreign one",
         "`motorbus setup calibrate` of this joint"),
        ("motion-blocked", "error", "a goal is acknowledged and nothing moves", "change this setting"),
        ("settings-left", "warning", "a program left it in RAM, maybe motorbus; it lasts until the supply is cut",
         "cut its supply for a moment"),
        ("no-acknowledgement", "warning", "writes are not acknowledged, so none can be confirmed",
         "`motorbus write {where} status_return_level=1`"),
        ("return-delay", "info", "each reply waits so long", "`motorbus write {where} return_delay=0`"),
        ("eeprom-open", "info", "LeRobot opens the lock with each torque-off; writes to EEPROM now stay",
         "`motorbus write {where} lock=1`"),
        ("project-error", "warning", "the project does not do what it seems to say",
         "`motorbus stepper read {where} --project N`, correct and write it"),
        ("homing-not-seen", "info", "it still searches, the switch is not connected, or it has moved since",
         "move onto the switch and look at `motorbus stepper io {where}`"),
    ),
    "machine": (
        ("machine-file", "error", "the file cannot be used", "correct this key"),
        ("axis-mismatch", "error", "the file was made for another model", "take the key out of the axis"),
        ("calibration-differs", "error", "the device was calibrated again or replaced after the file was written",
         "`motorbus setup calibrate`, or correct zero, low and high"),
        ("outside-limits", "warning", "it was moved by hand, or its zero is of another calibration",
         "move it inside by hand, or `motorbus setup calibrate`"),
        ("exit-falls", "info", "a joint that carries weight falls", 'write exit = "park" with a pose park'),
        ("estop-falls", "info", "a joint that carries weight falls", 'write estop = "hold" where that is safe'),
        ("loop-too-fast", "error", "the computer is late", "end other programs, or lower the rate"),
        ("loop-rate", "info", "the rate is reached", "nothing to do"),
        ("check-failed", "warning", "the line or the device failed during a check", "run the doctor again"),
    ),
}
# fmt: on
CODES: Final = {row[0]: Code(part, *row[1:]) for part, rows in _TABLE.items() for row in rows}
"""What stands first may be the cause of what stands later."""
SEVERITIES: Final = ("error", "warning", "info")
ORDER: Final = list(CODES)


class DeviceHealth(Struct, frozen=True):
    """What was measured at one device; latencies are those of a read."""

    model: str
    firmware: str
    voltage: Annotated[float | None, Meta(extra={"unit": "V"})] = None
    current: Annotated[float | None, Meta(extra={"unit": "A"})] = None
    temperature: Annotated[float | None, Meta(extra={"unit": "°C"})] = None
    lost: Annotated[float, Meta(extra={"unit": "%"})] = 0.0
    p50: Annotated[float | None, Meta(extra={"unit": "ms"})] = None
    p99: Annotated[float | None, Meta(extra={"unit": "ms"})] = None


class Report(Struct, frozen=True, tag="doctor"):
    """The findings, the first cause first, and the health of the devices that answer, by their names."""

    target: str
    findings: tuple[Finding, ...] = ()
    devices: dict[str, DeviceHealth] = {}
    simulated: bool = False

    def count(self, severity: str) -> int:
        """The number of findings of this severity."""
        return sum(one.severity == severity for one in self.findings)


def complete(one: Finding, bus: str) -> Finding:
    """The finding with what the table of codes says where it says nothing itself."""
    code = CODES[one.code]
    cause, action = one.cause or code.cause, one.action or code.action
    action = action.replace("{where}", one.where).replace("{bus}", bus)
    return structs.replace(one, cause=cause, action=action, severity=one.severity or code.severity)


def arrange(found: Iterable[Finding], bus: str) -> list[Finding]:
    """The findings of one bus in order, complete; equal ones at several places become one.

    An error of the bus explains its later findings, one of a device those of that device.
    """
    explained: list[Finding] = []
    for one in sort(_merge(complete(one, bus) for one in found)):
        causes = [first.code for first in explained if _explains(first, one, bus)]
        explained.append(structs.replace(one, because=causes[0]) if causes else one)
    return explained


def sort(found: Iterable[Finding]) -> list[Finding]:
    """Errors, warnings, facts; in each by the chain."""
    return sorted(
        found, key=lambda one: (SEVERITIES.index(one.severity or "error"), ORDER.index(one.code), one.where)
    )


def _merge(found: Iterable[Finding]) -> list[Finding]:
    groups: dict[tuple[str, ...], list[Finding]] = {}
    for one in found:
        groups.setdefault((one.code, one.severity or "", one.cause), []).append(one)
    return [
        structs.replace(
            group[0],
            where=", ".join(dict.fromkeys(one.where for one in group)),
            evidence="; ".join(dict.fromkeys(one.evidence for one in group)),
        )
        for group in groups.values()
    ]


def _explains(first: Finding, later: Finding, bus: str) -> bool:
    is_earlier = ORDER.index(first.code) < ORDER.index(later.code)
    if first.severity != "error" or first.because or later.severity == "info" or not is_earlier:
        return False
    return first.where == bus or bool(set(first.where.split(", ")) & set(later.where.split(", ")))
