"""One bus: its adapter, who answers, who is missing, how well the line works, what the devices say. Reads only."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from importlib import import_module
from statistics import median, quantiles
from typing import Any, Final

from msgspec import structs

from motorbus.bus.blocking import Bus
from motorbus.bus.trace import TraceRecord
from motorbus.core.can_frame import ERROR_FLAG, CanFrame
from motorbus.core.family import Found, Identity
from motorbus.core.findings import Finding, Severity, Subject
from motorbus.core.request import Request
from motorbus.core.steps import Sleep, catch
from motorbus.doctor import host
from motorbus.doctor.findings import DeviceHealth
from motorbus.errors import LinkError, MotorbusError

FIRST_IDS: Final = tuple(range(21))  # asked on a serial bus whose ids are not known
READS: Final = 120  # of all devices of a bus together
FEWEST: Final = 20  # of one device
SLOW_READS: Final = 10  # of a device without a position
SLOW: Final = 0.008  # s that a read may take beyond its air time
SLOWEST: Final = 0.1  # s of latency with which a bus is tried whose replies come too late
SLOW_CAUSE: Final = "the latency timer of the adapter (FTDI: 16 ms), a USB hub, or a network"
SLOW_FIX: Final = "set the latency timer to 1 ms, connect the adapter without a hub"
TRIES: Final = 3  # for a device that the scan missed
LOST: Final = 0.02  # share of reads that may fail
LISTEN: Final = 0.3  # s
TRACED: Final = 20_000  # records
TEXT: Final = re.compile(rb"[\t\n\r -~]{12,}")  # of a board that prints a menu


class BusDoctor:
    """The examination of one open bus. `names` are the names of the expected devices by id, in order of the chain."""

    def __init__(self, bus: Bus, where: str, names: Mapping[int, str] = {}, ids: Sequence[int] = ()) -> None:
        self.bus, self.where, self.names = bus, where, names
        self.ids = tuple(dict.fromkeys([*names, *ids]))
        self.checks: Any = import_module(bus.family.checks_module)
        self.found: list[Finding] = []
        self.subjects: dict[int, Subject] = {}
        self.health: dict[str, DeviceHealth] = {}
        self.trace: list[TraceRecord] = []
        """What went over the wire, for the bundle."""
        self._records = bus.trace.subscribe(TRACED)
        self.suspects: dict[int, str] = {}
        self._is_can = bus.family.link.kind == "frames"

    def add(self, severity: Severity, code: str, where: str, *texts: str) -> None:
        """Add a finding: evidence, cause, action."""
        self.found.append(Finding(code, severity, where, *texts))

    def name(self, node: int) -> str:
        """How a device is named: its axis, else its address."""
        number = f"{node:#x}" if self._is_can else str(node)
        return self.names.get(node) or f"{self.where}#{number}"

    def examine(self) -> None:
        """Find what is wrong with the bus, then with each device. A lost port ends it."""
        try:
            self._check_adapter()
            if self._is_can:
                self.bus.run(Sleep(LISTEN))
            present = self._scan(self._wanted())
            if not present and self._received():
                present = self._scan_slowly()
            if not present:
                self._explain_silence()
                return
            present += self._ask_again(
                [node for node in self.ids if node not in [one.node for one in present]]
            )
            self._check_missing([one.node for one in present])
            self._check_ids(present)
            self._check_line([one.node for one in present])
            self._check_devices(present)
        except LinkError as error:
            self.found.append(host.explain(error, self.where))
        finally:
            self.trace += self._records

    def _wanted(self) -> tuple[int, ...]:
        if self._is_can or self.bus.family.link.only is not None:
            return ()
        return tuple(dict.fromkeys([*FIRST_IDS, *self.ids]))

    def _scan(self, ids: Sequence[int], rates: Sequence[int] = ()) -> list[Found]:
        if (only := self.bus.family.link.only) is not None:
            return self._ask_again([only])

        def report(event: Any) -> None:
            if "two servos" in getattr(event, "what", ""):
                self.suspects[event.node] = event.what

        found: list[Found] = self.bus.run(self.bus.driver.scan(tuple(ids), tuple(rates)), report)
        return found

    def _scan_slowly(self) -> list[Found]:
        """Scan with longer time-outs: replies came, and may have been late."""
        before, self.bus.latency = self.bus.latency, SLOWEST
        found = self._scan(self._wanted())
        if found:
            evidence = f"replies come later than {1000 * before:.0f} ms, within {1000 * SLOWEST:.0f} ms"
            self.add("error", "latency-timer", self.where, evidence, SLOW_CAUSE, SLOW_FIX)
        else:
            self.bus.latency = before
        return found

    def _ask_again(self, silent: Sequence[int]) -> list[Found]:
        """A device with a loose plug may have missed the scan."""
        found = []
        for node in silent:
            for _ in range(TRIES):
                identity = self.bus.run(catch(self.bus.driver.identify(node)))
                if isinstance(identity, LinkError):
                    raise identity
                if isinstance(identity, Identity):
                    found.append(Found(node, self.bus.rate, identity))
                    break
        return found

    # -- adapter -----------------------------------------------------------------------------------------------

    def _check_adapter(self) -> None:
        if self.bus.echoes:
            cause = "RX and TX are joined; motorbus removes the echo, LeRobot and the FEETECH SDK do not"
            fix = "set the jumper of the board, or use this adapter with motorbus only"
            self.add("warning", "adapter-echo", self.where, "each request comes back", cause, fix)
        for text in self.bus.warnings:
            if "latency timer" in text:
                evidence, _, fix = text.partition(": ")
                cause = "the adapter collects bytes before it passes them on"
                self.add("warning", "latency-timer", self.where, evidence, cause, fix)

    def _received(self) -> list[Any]:
        """What came in, without the echo of what was sent."""
        self.trace += self._records
        sent = [one.data for one in self.trace if one.direction == "tx"]
        return [one.data for one in self.trace if one.direction == "rx" and one.data not in sent]

    # -- silence -----------------------------------------------------------------------------------------------

    def _explain_silence(self) -> None:
        received = self._received()
        others = [rate for rate in self.bus.family.link.rates if rate != self.bus.rate]
        if others and (found := self._scan(self._wanted() if not self.names else tuple(self.names), others)):
            self._report_rate(found, "can-wrong-bitrate" if self._is_can else "wrong-rate", self.where)
        elif self._is_can:
            self._explain_can_silence(received)
        else:
            self._explain_serial_silence(b"".join(one for one in received if isinstance(one, bytes)))

    def _report_rate(self, found: Sequence[Found], code: str, where: str) -> None:
        ids = ", ".join(f"#{one.node}" for one in found)
        rate, option = found[0].rate, "bitrate" if self._is_can else "baud"
        evidence = f"{ids} at {rate} bit/s, the bus is open at {self.bus.rate} bit/s"
        fix = f"open the bus with {option}={rate}, or `motorbus set-baud` there"
        self.add("error", code, where, evidence, "the devices are set to another rate", fix)

    def _explain_can_silence(self, received: Sequence[Any]) -> None:
        frames = Counter(
            f"{one.id:#x}" for one in received if isinstance(one, CanFrame) and not one.id & ERROR_FLAG
        )
        if trouble := self.bus.engine.diagnosis():
            cause = "no powered node, another bit rate, no termination, or CAN-H and CAN-L swapped"
            fix = "check supply and wiring; 60 ohm between CAN-H and CAN-L"
            self.add("error", "adapter-no-ack", self.where, trouble, cause, fix)
        elif frames:
            ids = ", ".join(list(frames)[:6])
            cause = "a node sends and does not answer reads: another protocol, or another form of identifiers"
            fix = "look at the frames with `motorbus monitor --listen`"
            self.add("error", "can-mute-node", self.where, f"frames {ids}, no reply to a read", cause, fix)
        else:
            cause = "no supply, no termination, a cable, or an adapter that is not on this bus"
            fix = "check supply, CAN-H, CAN-L and two resistors of 120 ohm"
            evidence = f"no frame in {LISTEN} s, no reply at any rate"
            self.add("error", "can-silent", self.where, evidence, cause, fix)

    def _explain_serial_silence(self, received: bytes) -> None:
        if text := TEXT.search(received):
            shown = text[0].decode().strip()[:40]
            cause = "the board prints text: an ESP32 in its menu, or another program on the adapter"
            fix = "put the board into its serial forwarding mode"
            self.add("error", "adapter-menu", self.where, f"received {shown!r}", cause, fix)
        elif received and self.bus.family.link.only is not None:
            cause = "another device, another rate, or another byte format"
            evidence = f"{len(received)} bytes that are no reply, as {received[:8].hex(' ').upper()}"
            self.add(
                "error", "stepper-foreign", self.where, evidence, cause, "check which device is on this line"
            )
        elif received:
            cause = "another program on this bus, another protocol, or noise"
            evidence = f"{len(received)} bytes, no valid reply"
            self.add(
                "error", "line-noise", self.where, evidence, cause, "close other programs, check the ground"
            )
        else:
            rates = len(self.bus.family.link.rates)
            cause = "no supply, or the data line is not connected"
            evidence = f"no reply at {rates} rate{'s' if rates > 1 else ''}"
            fix = "check the supply and the cable to the first device"
            self.add("error", "bus-silent", self.where, evidence, cause, fix)

    # -- chain and ids -----------------------------------------------------------------------------------------

    def _check_missing(self, answering: Sequence[int]) -> None:
        chain = list(dict.fromkeys([*self.names, *self.ids]))
        missing = [node for node in chain if node not in answering]
        if not missing:
            return
        if not self._is_can:
            others = [rate for rate in self.bus.family.link.rates if rate != self.bus.rate]
            elsewhere = self._scan(missing, others)
            for one in elsewhere:
                self._report_rate([one], "wrong-rate", self.name(one.node))
                missing.remove(one.node)
        first = chain.index(missing[0]) if missing else 0
        fresh = self.checks.FACTORY_ID
        if len(missing) == 1 and fresh in answering and fresh not in chain:
            cause = f"a device with the factory id {fresh} answers in its place"
            fix = f"`motorbus set-id {self.where}#{fresh} {missing[0]}`"
        elif first and missing == chain[first:]:
            cause = f"the cable after {self.name(chain[first - 1])}, or the devices after it have no supply"
            fix = f"check the plug between {self.name(chain[first - 1])} and {self.name(missing[0])}"
        else:
            cause, fix = (
                "its plug, its supply, or it has another id",
                "plug it in again, then `motorbus scan`",
            )
        evidence = f"{len(chain) - len(missing)} of {len(chain)} answer"
        for node in missing:
            self.add("error", "device-missing", self.name(node), evidence, cause, fix)

    def _check_ids(self, present: Sequence[Found]) -> None:
        if len(self.suspects) == len(present) > 1:
            self.suspects.clear()  # noise disturbs all, a second device only its own id
        for node, evidence in self.suspects.items():
            cause = "two devices have this id and answer at once; new ones share the factory id"
            fix = f"connect one of them alone, then `motorbus set-id {self.where}#{node} NEW`"
            self.add("error", "duplicate-id", self.name(node), evidence, cause, fix)
        if not self.names:
            return
        for node in (one.node for one in present if one.node not in self.names):
            evidence, cause = (
                f"id {node} answers, no axis has it",
                "a new device, or an axis is not in the file",
            )
            if node == self.checks.FACTORY_ID:
                fix = f"`motorbus set-id {self.where}#{node} NEW`"
                self.add("warning", "factory-id", self.name(node), evidence, cause, fix)
            else:
                fix = "add an axis to the machine file"
                self.add("info", "device-unnamed", self.name(node), evidence, cause, fix)

    # -- line --------------------------------------------------------------------------------------------------

    def _check_line(self, nodes: Sequence[int]) -> None:
        """Read each device many times; count what is lost or damaged, and measure the latency."""
        excess: list[float] = []
        for node in nodes:
            request, reads = self._read_request(node, len(nodes))
            before, times = Counter(self.bus.statistics.of(node).errors), []
            for _ in range(reads):
                start = self.bus.now()
                value = self.bus.run(catch(request))
                if isinstance(value, LinkError):
                    raise value
                if not isinstance(value, MotorbusError):
                    times.append(self.bus.now() - start)
            errors = self.bus.statistics.of(node).errors - before
            self._judge_line(node, errors, reads)
            lost = 100 * errors.total() / (reads + errors.total())
            points = [1000 * time for time in quantiles(times, n=100)] if len(times) > 1 else [0.0] * 99
            self.health[self.name(node)] = DeviceHealth("", "", lost=lost, p50=points[49], p99=points[98])
            if times:
                excess.append(median(times) - self.bus.engine.air_time(request))
        if excess and min(excess) > SLOW and not any(one.code == "latency-timer" for one in self.found):
            evidence = f"each read takes {1000 * min(excess):.0f} ms longer than its bytes, limit {1000 * SLOW:.0f} ms"
            self.add("warning", "latency-timer", self.where, evidence, SLOW_CAUSE, SLOW_FIX)

    def _read_request(self, node: int, devices: int) -> tuple[Request[Any], int]:
        probe = self.bus.driver.probe(node, 0)
        identity = self.bus.run(catch(self.bus.driver.identify(node)))
        if isinstance(identity, MotorbusError):
            return probe, FEWEST
        axis = self.bus.driver.axis(identity)
        if "position" not in axis:
            return probe, SLOW_READS if self.bus.family.link.only is not None else FEWEST
        request = axis.position(self.bus.family.devices.blocking(self.bus, node))
        return (request if isinstance(request, Request) else probe), max(FEWEST, READS // devices)

    def _judge_line(self, node: int, errors: Counter[str], reads: int) -> None:
        if node in self.suspects or errors.total() < 2 or errors.total() / reads < LOST:
            return
        silent = errors["silence"]
        evidence = f"{errors.total()} of {reads + errors.total()} reads failed, limit {LOST:.0%}"
        if silent * 2 > errors.total():
            cause = "a loose plug, a supply that dips, or an adapter that is too slow"
            fix = "plug the cables in again; then check the supply under load"
            self.add("error", "replies-lost", self.name(node), evidence, cause, fix)
        else:
            cause = "a long cable, a missing ground, no termination, or another program on the bus"
            fix = "shorten the cable, connect the grounds, close other programs"
            kinds = ", ".join(f"{count} {kind}" for kind, count in errors.items())
            self.add("error", "line-noise", self.name(node), f"{evidence} ({kinds})", cause, fix)

    # -- devices -----------------------------------------------------------------------------------------------

    def _check_devices(self, present: Sequence[Found]) -> None:
        versions: dict[str, dict[str, list[str]]] = {}
        for one in present:
            if one.identity is None:
                continue
            device = self.bus.family.devices.blocking(self.bus, one.node)
            subject = Subject(device, one.identity, self.name(one.node))
            self.subjects[one.node] = subject
            identity = one.identity
            versions.setdefault(identity.model, {}).setdefault(identity.firmware, []).append(subject.where)
            if not identity.table:
                cause = "no source describes this firmware; the doctor reads what all maps share"
                fix = "use a known model; `motorbus info` shows what it says of itself"
                evidence = f"{identity.model}, firmware {identity.firmware}: unknown register map"
                subject.error("model-unknown", evidence, cause, fix)
            else:
                self._run_checks(subject)
            self._measure(subject)
            self.found += subject.found
        for model, firmwares in versions.items():
            if len(firmwares) > 1:
                evidence = "; ".join(
                    f"{firmware}: {', '.join(names)}" for firmware, names in firmwares.items()
                )
                cause = f"{model} with several firmware versions; LeRobot refuses such an arm"
                fix = "update them with the tool of the maker, or use motorbus, which needs no equal versions"
                self.add("warning", "firmware-mixed", self.where, evidence, cause, fix)

    def _run_checks(self, subject: Subject) -> None:
        for check in self.checks.CHECKS:
            error = self.bus.run(catch(check(subject)))
            if isinstance(error, LinkError):
                raise error
            if isinstance(error, MotorbusError) and subject.device.node not in self.suspects:
                cause = error.cause or "the line or the device failed during the check"
                subject.warn("check-failed", error.summary, cause, error.advice or "run the doctor again")

    def _measure(self, subject: Subject) -> None:
        axis = self.bus.driver.axis(subject.identity)
        values: dict[str, Any] = {"model": subject.identity.model, "firmware": subject.identity.firmware}
        if "state" in axis:
            state = self.bus.run(catch(axis.state(subject.device)))
            if not isinstance(state, MotorbusError):
                values |= {name: getattr(state, name) for name in ("voltage", "current", "temperature")}
        self.health[subject.where] = structs.replace(self.health[subject.where], **values)
