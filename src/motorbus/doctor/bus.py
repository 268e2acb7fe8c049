"""One bus: its adapter, who answers, who is missing, how well the line works, what the devices say. Reads only."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from statistics import median, quantiles
from typing import Any, Final, TypeVar

from msgspec import structs

from motorbus.bus.blocking import Bus
from motorbus.bus.trace import TraceRecord
from motorbus.core.can_frame import ERROR_FLAG, CanFrame
from motorbus.core.family import Found, Identity, State
from motorbus.core.findings import Finding, Subject
from motorbus.core.request import Request
from motorbus.core.steps import Runnable, Sleep, catch, discard
from motorbus.doctor.findings import DeviceHealth
from motorbus.errors import Interrupted, LinkError, MotorbusError

T = TypeVar("T")

FIRST_IDS: Final = tuple(range(21))  # asked on a serial bus
READS: Final = 120  # of all devices of a bus together
FEWEST: Final = 20  # of one device
SLOW_READS: Final = 10  # of a device without a position
TRIES: Final = 3  # for a device that the scan missed
LOST: Final = 0.02  # share of reads that may fail
SAG: Final = 1.5  # V that a device may have less than the others # assumption
SLOW: Final = 0.008  # s that a read may take beyond its air time
SLOWEST: Final = 0.1  # s of latency with which a bus is tried whose replies come too late
LISTEN: Final = 0.3  # s
TRACED: Final = 20_000  # records
TEXT: Final = re.compile(rb"[\t\n\r -~]{12,}")  # of a board that prints a menu


class BusDoctor:
    """The examination of one open bus. `names` are the axes of the machine file by id, `ids` other expected ids.

    It ends with Interrupted once `is_stopped`.
    """

    def __init__(
        self,
        bus: Bus,
        where: str,
        names: Mapping[int, str] = {},
        ids: Sequence[int] = (),
        *,
        tries_rates: bool = True,
        is_stopped: Callable[[], bool] = bool,
    ) -> None:
        self.bus, self.where, self.names = bus, where, names
        self.chain = list(dict.fromkeys([*names, *ids]))
        self.checks: Any = import_module(bus.family.checks_module)
        self.found: list[Finding] = []
        self.subjects: dict[int, Subject] = {}
        self.health: dict[str, DeviceHealth] = {}
        self._trace: list[TraceRecord] = []
        self._records = bus.trace.subscribe(TRACED)
        self._suspects: dict[int, str] = {}
        """Ids that two devices seem to have, and the evidence."""
        self._tries_rates = tries_rates
        self._is_stopped = is_stopped
        self._is_can = bus.family.link.kind == "frames"

    def add(self, code: str, where: str, evidence: str, cause: str = "", action: str = "") -> None:
        """Add a finding."""
        self.found.append(Finding(code, where, evidence, cause, action))

    def name(self, node: int) -> str:
        """How a device is named: its axis, else its address."""
        return self.names.get(node) or f"{self.where}#{f'{node:#x}' if self._is_can else node}"

    @property
    def trace(self) -> list[TraceRecord]:
        """What went over the wire."""
        self._trace += self._records
        return self._trace

    def end(self) -> None:
        """Stop recording what goes over the wire."""
        self.bus.trace.unsubscribe(self._records)

    def read(self, runnable: Runnable[T]) -> T | MotorbusError:
        """The value, or the error as a value; a lost port is raised, and Interrupted after a stop."""
        if self._is_stopped():
            discard(runnable)
            raise Interrupted("the doctor was stopped", advice="run it again")
        value = self.bus.run(catch(runnable))
        if isinstance(value, LinkError):
            raise value
        return value

    def examine(self) -> None:
        """Find what is wrong with the bus, then with each device. Raises LinkError for a lost port."""
        self._check_adapter()
        present = self._search()
        if not present:
            self._explain_silence()
            return
        answering = [one.node for one in present]
        self._check_missing(answering)
        self._check_ids(answering)
        self._check_line(answering)
        self._check_devices(present)

    def _check_adapter(self) -> None:
        if self.bus.echoes:
            self.add("adapter-echo", self.where, "each request comes back")
        for text in self.bus.warnings:
            if "latency timer" in text:
                evidence, _, fix = text.partition(": ")
                self.add("latency-timer", self.where, evidence, action=fix)

    # -- who answers -------------------------------------------------------------------------------------------

    def _search(self) -> list[Found]:
        if self._is_can:
            self.bus.run(Sleep(LISTEN))
        present = self._scan()
        if not present and self._received():  # maybe replies that came too late
            before, self.bus.latency = self.bus.latency, SLOWEST
            if present := self._scan():
                evidence = f"replies come later than {1000 * before:.0f} ms, within {1000 * SLOWEST:.0f} ms"
                self.add("latency-timer", self.where, evidence)
            else:
                self.bus.latency = before
        if present:
            answering = [one.node for one in present]
            gaps = () if self._is_can else range(min(answering), max(answering))
            present += self._ask_again([node for node in self.chain or gaps if node not in answering])
        return sorted(present, key=lambda one: one.node)

    def _scan(self, ids: Sequence[int] = (), rates: Sequence[int] = ()) -> list[Found]:
        if (only := self.bus.family.link.only) is not None:
            return self._ask_again([only])
        if not ids and not self._is_can:
            ids = tuple(dict.fromkeys([*FIRST_IDS, *self.chain]))

        def report(event: Any) -> None:
            if "two servos" in getattr(event, "what", ""):
                self._suspects[event.node] = event.what

        found = self.bus.run(self.bus.driver.scan(tuple(ids), tuple(rates)), report)
        if len(found) > 1 and not any(one.identity for one in found):  # something else answers everything
            self._suspects.clear()
            return []
        return found

    def _ask_again(self, silent: Sequence[int]) -> list[Found]:
        """Those of these ids that answer one of several reads, as with a loose plug."""
        found = []
        for node in silent:
            for _ in range(TRIES):
                identity = self.read(self.bus.driver.identify(node))
                if isinstance(identity, Identity):
                    found.append(Found(node, self.bus.rate, identity))
                    break
        return found

    def _received(self) -> list[Any]:
        """What came in, without the echo of what was sent."""
        records = self.trace
        sent = {one.data for one in records if one.direction == "tx"}
        return [one.data for one in records if one.direction == "rx" and one.data not in sent]

    def _scan_other_rates(self, ids: Sequence[int]) -> list[Found]:
        others = [rate for rate in self.bus.family.link.rates if rate != self.bus.rate]
        return self._scan(ids, others) if others and self._tries_rates else []

    def _report_rate(self, found: Sequence[Found], where: str) -> None:
        code, option = ("can-wrong-bitrate", "bitrate") if self._is_can else ("wrong-rate", "baud")
        ids, rate = ", ".join(f"#{one.node}" for one in found), found[0].rate
        evidence = f"{ids} at {rate} bit/s, the bus is open at {self.bus.rate} bit/s"
        self.add(
            code, where, evidence, action=f"open the bus with {option}={rate}, or `motorbus set-baud` there"
        )

    def _explain_silence(self) -> None:
        received = self._received()
        stray = b"".join(one for one in received if isinstance(one, bytes))
        frames = {
            f"{one.id:#x}": one for one in received if isinstance(one, CanFrame) and not one.id & ERROR_FLAG
        }
        if found := self._scan_other_rates(self.chain):
            self._report_rate(found, self.where)
        elif trouble := self.bus.engine.diagnosis():
            self.add("adapter-no-ack", self.where, trouble)
        elif frames:
            self.add("can-mute-node", self.where, f"frames {', '.join([*frames][:6])}, no reply to a read")
        elif self._is_can:
            self.add(
                "can-silent",
                self.where,
                f"no frame in {LISTEN} s, no reply{' at any rate' * self._tries_rates}",
            )
        elif text := TEXT.search(stray):
            self.add("adapter-menu", self.where, f"received {text[0].decode().strip()[:40]!r}")
        elif stray:
            code = "line-noise" if self.bus.family.link.only is None else "stepper-foreign"
            evidence = f"{len(stray)} bytes that are no reply, as {stray[:8].hex(' ').upper()}"
            self.add(code, self.where, evidence)
        else:
            tried = len(self.bus.family.link.rates) if self._tries_rates else 1
            self.add("bus-silent", self.where, f"no reply, rates tried: {tried}")

    def _check_missing(self, answering: Sequence[int]) -> None:
        missing = [node for node in self.chain if node not in answering]
        evidence = f"{len(self.chain) - len(missing)} of {len(self.chain)} answer"
        if missing and not self._is_can:  # on CAN a scan at another rate disturbs those that work
            for one in self._scan_other_rates(missing):
                self._report_rate([one], self.name(one.node))
                missing.remove(one.node)
        if not missing:
            return
        first, fresh, cause, fix = self.chain.index(missing[0]), self.checks.FACTORY_ID, "", ""
        if len(missing) == 1 and fresh in answering and fresh not in self.chain:
            cause = f"a device with the factory id {fresh} answers in its place"
            fix = f"`motorbus set-id {self.where}#{fresh} {missing[0]}`"
        elif first and missing == self.chain[first:]:
            before = self.name(self.chain[first - 1])
            cause = f"the cable after {before}, or the devices after it have no supply"
            fix = f"check the plug between {before} and {self.name(missing[0])}"
        heard = {one.id & 0x7F for one in self._received() if isinstance(one, CanFrame)}
        for node in missing:
            if node in heard:
                self.add("can-mute-node", self.name(node), "it sends frames, no reply to a read")
            else:
                self.add("device-missing", self.name(node), evidence, cause, fix)

    def _check_ids(self, answering: Sequence[int]) -> None:
        if len(self._suspects) == len(answering) > 1:
            self._suspects.clear()  # noise disturbs all, a second device only its own id
        for node, evidence in self._suspects.items():
            self.add("duplicate-id", self.name(node), evidence)
        for node in answering if self.chain else ():
            if node in self.chain:
                continue
            if node == self.checks.FACTORY_ID:
                self.add("factory-id", self.name(node), f"the factory id {node} answers, it is not expected")
            elif self.names:
                self.add("device-unnamed", self.name(node), f"id {node} answers, no axis has it")

    # -- line --------------------------------------------------------------------------------------------------

    def _check_line(self, nodes: Sequence[int]) -> None:
        """Read each device many times; count what is lost or damaged, and measure the latency."""
        excess: list[float] = []
        for node in nodes:
            request, reads = self._read_request(node, len(nodes))
            statistics, times = self.bus.statistics.of(node), []
            before = Counter(statistics.errors)
            for _ in range(reads):
                start = self.bus.now()
                if not isinstance(self.read(request), MotorbusError):
                    times.append(self.bus.now() - start)
            errors = statistics.errors - before
            self._judge_line(node, errors, reads)
            lost = 100 * errors.total() / (reads + errors.total())
            self.health[self.name(node)] = DeviceHealth("", "", lost=round(lost, 1))
            if len(times) > 1:
                points = [round(1000 * time, 2) for time in quantiles(times, n=100)]
                line = {"p50": points[49], "p99": points[98]}
                self.health[self.name(node)] = structs.replace(self.health[self.name(node)], **line)
                excess.append(median(times) - self.bus.engine.air_time(request))
        if excess and min(excess) > SLOW and not any(one.code == "latency-timer" for one in self.found):
            measured, limit = 1000 * min(excess), 1000 * SLOW
            evidence = f"a read takes {measured:.0f} ms longer than its bytes, limit {limit:.0f} ms"
            self.add("latency-timer", self.where, evidence)

    def _read_request(self, node: int, devices: int) -> tuple[Request[Any], int]:
        """A read of this device that may be repeated, and how often."""
        identity = self.read(self.bus.driver.identify(node))
        if isinstance(identity, Identity) and "position" in (axis := self.bus.driver.axis(identity)):
            request = axis.position(self.bus.family.devices.blocking(self.bus, node))
            if isinstance(request, Request):
                return request, max(FEWEST, READS // devices)
        return self.bus.driver.probe(node, 0), SLOW_READS

    def _judge_line(self, node: int, errors: Counter[str], reads: int) -> None:
        failed = errors.total()
        if node in self._suspects or failed < 2 or failed / reads < LOST:
            return
        kinds = ", ".join(f"{count} {kind}" for kind, count in errors.items())
        evidence = f"{failed} of {reads + failed} reads failed ({kinds}), limit {LOST:.0%}"
        broken = self._is_can and any(one.id & ERROR_FLAG for one in self._received())
        is_silent = errors["silence"] * 2 > failed and not broken
        self.add("replies-lost" if is_silent else "line-noise", self.name(node), evidence)

    # -- devices -----------------------------------------------------------------------------------------------

    def _check_devices(self, present: Sequence[Found]) -> None:
        versions: dict[str, dict[str, list[str]]] = {}
        for one in present:
            if (identity := one.identity) is None:
                continue
            device = self.bus.family.devices.blocking(self.bus, one.node)
            subject = self.subjects[one.node] = Subject(device, identity, self.name(one.node))
            versions.setdefault(identity.model, {}).setdefault(identity.firmware, []).append(subject.where)
            if identity.table:
                self._run_checks(subject)
            else:
                evidence = f"{identity.model}, firmware {identity.firmware}: unknown register map"
                subject.add("model-unknown", evidence)
            self._measure(subject)
            self.found += subject.found
        self._check_supplies()
        for model, firmwares in versions.items():
            if len(firmwares) > 1:
                shown = "; ".join(f"{firmware}: {', '.join(names)}" for firmware, names in firmwares.items())
                self.add("firmware-mixed", self.where, f"{model} {shown}")

    def _check_supplies(self) -> None:
        """A device whose supply is far below that of the others of its model."""
        for subject in self.subjects.values():
            own = self.health[subject.where]
            alike = [one.voltage for one in self.health.values() if one.model == own.model and one.voltage]
            if own.voltage and own.voltage < (usual := median(alike)) - SAG:
                evidence = f"supply {own.voltage:.1f} V, of the others {usual:.1f} V"
                self.add("supply-sag", subject.where, evidence, "a long or thin cable, or a loose plug")

    def _run_checks(self, subject: Subject) -> None:
        for check in self.checks.CHECKS:
            error = self.read(check(subject))
            if isinstance(error, MotorbusError) and subject.device.node not in self._suspects:
                subject.add("check-failed", error.summary, error.cause, error.advice)

    def _measure(self, subject: Subject) -> None:
        axis, identity = self.bus.driver.axis(subject.identity), subject.identity
        values: dict[str, Any] = {"model": identity.model, "firmware": identity.firmware}
        if "state" in axis and isinstance(state := self.read(axis.state(subject.device)), State):
            values |= {name: getattr(state, name) for name in ("voltage", "current", "temperature")}
        self.health[subject.where] = structs.replace(self.health[subject.where], **values)
