"""Staged faults and healthy machines: the first finding, and only reads on the wire."""

from __future__ import annotations

import json
import random
import zipfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import motorbus
from motorbus import families
from motorbus.bus.blocking import Bus
from motorbus.cli import main
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Effect
from motorbus.core.steps import INTENT, JournalEntry
from motorbus.doctor import examine
from motorbus.doctor.bus import BusDoctor
from motorbus.doctor.explain import explain
from motorbus.doctor.findings import CODES, Report
from motorbus.doctor.trial import move_axes
from motorbus.errors import LinkError, RequestError
from motorbus.families.stepper.protocol import decode_request
from motorbus.journal import BusJournal
from motorbus.link import errors
from motorbus.link.errors import Owner
from motorbus.link.memory import MemoryLink
from motorbus.simulation import Simulation
from tests.doctor.scenarios import ACCEPTED, SCENARIOS, Scenario, axes

READS = (0x01, 0x02, 0x82)  # PING, READ, SYNC READ of a FEETECH servo
UPLOAD = 0x40  # SDO


def only_reads(data: bytes | CanFrame, family: str) -> bool:
    """Whether what a host sent is a read, by the bytes."""
    if isinstance(data, CanFrame):
        return data.id >> 7 == 0x600 >> 7 and data.data[0] == UPLOAD
    if family == "feetech":
        return data[4] in READS and len(data) == data[3] + 4
    found = decode_request(data)
    return found is not None and found[0].effect is Effect.NONE


@contextmanager
def simulated(scenario: Scenario) -> Iterator[tuple[Simulation, list[Any]]]:
    """The simulated bus of a scenario, and what hosts send to it."""
    options = dict(scenario.options)
    sent: list[Any] = []
    with motorbus.simulate(scenario.family, ids=scenario.ids, **options) as sim:
        receive = sim.simulator.receive

        def sniff(data: Any, at: float) -> None:
            sent.append(data)
            receive(data, at)

        sim.simulator.receive = sniff  # type: ignore[method-assign]
        yield sim, sent


def carry_out(sim: Simulation, stage: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The orders of a stage: a device or `all`, a word, arguments."""
    for order in filter(None, (part.strip() for part in stage.split(";"))):
        who, word, *words = order.split()
        nodes = list(sim.simulator.nodes.values()) if who == "all" else [sim[int(who, 0)]]
        for node in nodes:
            _order(sim, node, int(who, 0) if who != "all" else 0, word, words, monkeypatch)


def _order(
    sim: Simulation, node: Any, id: int, word: str, words: list[str], patch: pytest.MonkeyPatch
) -> None:
    match word:
        case "unplug":
            node.unplug()
        case "supply":
            node.voltage = float(words[0])
        case "heat":
            node.temperature = float(words[0])
        case "alarm":
            node.alarm = int(words[0])
        case "load":
            node.load_shaft(float(words[0]) / 100)
        case "position":
            node.raw_position = int(words[0])
        case "write":
            node.memory[words[0]] = int(words[1])
            node.move()
        case "value":
            node.values[words[0]] = int(words[1], 0)
        case "project":
            node.put(1, replace(node.store.project(1), **{words[0]: int(words[1])}))
        case "loose":
            turns = iter(range(1_000_000))
            patch.setattr(
                type(node), "plugged", property(lambda one: one is not node or next(turns) % 5 != 0)
            )
        case "mute":
            _report_only(node)
        case "unfinished":
            journal = BusJournal(sim.url)
            journal(JournalEntry("set_id", INTENT, {"node": id, "what": "the id of a servo"}))
            patch.setattr("motorbus.doctor.machine.unfinished", lambda bus: journal.unfinished())
        case _:
            raise ValueError(word)


def _report_only(node: Any) -> None:
    """It sends reports and answers nothing."""
    node.started = True
    node._set_reporting(0.0)
    node.receive = lambda *_: None


def examined(scenario: Scenario, sim: Simulation, folder: Path) -> Report:
    address = sim.url.partition(",")[0] + scenario.bus if scenario.bus else sim.url
    if scenario.family == "kst" and "bit_rate" in scenario.options:
        address = sim.url.partition(",")[0]
    if not scenario.machine:
        ids = f"#{scenario.expect.replace(',', '+')}" if scenario.expect else ""
        return examine.examine_bus(address + ids, {}, scenario.rate)
    file = folder / "machine.toml"
    file.write_text(f'format = 1\n[bus.arm]\naddress = "{address}"\n{scenario.machine}')
    return examine.examine_machine(str(file), {}, scenario.rate)


@pytest.fixture(autouse=True)
def _calibrations(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_LEROBOT_CALIBRATION", str(tmp_path / "calibration"))


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda one: one.title)
def test_the_first_finding_names_the_fault(
    scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, text in scenario.saved.items():
        file = tmp_path / "calibration" / f"{name}.json"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    with simulated(scenario) as (sim, sent):
        carry_out(sim, scenario.stage, monkeypatch)
        report = examined(scenario, sim, tmp_path)
        assert report.findings, "nothing found"
        first = report.findings[0]
        accepted = ACCEPTED.get(scenario.title, scenario.code)
        assert first.code in (scenario.code, accepted), [
            f"{one.code} {one.where} {one.evidence}" for one in report.findings
        ]
        assert scenario.where in first.where
        assert all(one.evidence and one.cause and one.action for one in report.findings)
        assert all(only_reads(data, scenario.family) for data in sent)


# -- healthy machines ------------------------------------------------------------------------------------------

SERVOS = ("sts3215", "sts3032", "scs0009", "hls3925", "sts3250")


def random_bus(dice: random.Random) -> tuple[Scenario, str]:
    """A healthy bus of one to eight devices, and the keys of its axes."""
    family = dice.choice(("feetech", "feetech", "kst", "stepper"))
    if family == "stepper":
        return Scenario(title="", code="", family=family, ids="1"), "1"
    count = dice.randint(1, 8)
    if family == "kst":
        first = dice.randint(1, 100)
        ids = "+".join(f"{id:#x}" for id in range(first, first + count))
        profile = dice.choice(("kst", "kst-ext", "xqpower"))
        return Scenario(title="", code="", family=family, ids=ids, options={"profile": profile}), ids
    ids = "+".join(map(str, sorted(dice.sample(range(1, 21), count))))
    models = "+".join(dice.choice(SERVOS) for _ in range(count))
    options = {"model": models, "position": dice.randint(300, 900)}
    return Scenario(title="", code="", ids=ids, options=options), ids


@pytest.mark.parametrize("seed", range(20))
def test_a_healthy_machine_has_no_finding_above_info(seed: int, tmp_path: Path) -> None:
    dice = random.Random(seed)
    text, wires = "format = 1\n", []
    with ExitStack() as stack:
        for number in range(dice.randint(1, 3)):
            scenario, ids = random_bus(dice)
            sim, sent = stack.enter_context(simulated(scenario))
            wires.append((scenario.family, sent))
            name = f"b{number}"
            text += f'[bus.{name}]\naddress = "{sim.url}"\n'
            text += axes(ids, bus=name).replace("[axis.", f"[axis.{name}")
        file = tmp_path / "machine.toml"
        file.write_text(text)
        report = examine.examine_machine(str(file), {})
        assert [one for one in report.findings if one.severity != "info"] == []
        assert len(report.devices) == text.count("[axis.")
        assert all(sent and all(only_reads(data, family) for data in sent) for family, sent in wires)


# -- faults that are staged without a simulated device ---------------------------------------------------------


class Prints:
    """A board that answers each write with a line of its menu, or with other bytes."""

    def __init__(self, text: bytes) -> None:
        self.nodes: dict[int, Any] = {}
        self.text, self._waiting = text, list[tuple[float, bytes]]()

    def receive(self, data: Any, at: float) -> None:
        self._waiting.append((at + 0.001, self.text))

    def advance(self, to: float) -> list[tuple[float, bytes]]:
        ready, self._waiting = [one for one in self._waiting if one[0] <= to], []
        return ready

    def due(self) -> float | None:
        return self._waiting[0][0] if self._waiting else None

    def tune(self, rate: int) -> None: ...


@pytest.mark.parametrize(
    ("family", "text", "code"),
    [
        ("feetech", b"ESP32 servo driver\r\n1: scan 2: id\r\n", "adapter-menu"),
        ("feetech", b"\x01\xff\x80\x91\x00\xfe", "line-noise"),
        ("stepper", b"\x01\x03\x04\x00\x0a\xff\xf0\x77", "stepper-foreign"),
    ],
)
def test_something_else_answers(family: str, text: bytes, code: str) -> None:
    known = families.load(family)
    bus = Bus(MemoryLink(Prints(text), rate=known.link.rate), known.open())  # type: ignore[arg-type]
    with bus:
        doctor = BusDoctor(bus, "arm")
        doctor.examine()
    assert [one.code for one in doctor.found] == [code]


def test_a_frame_that_no_node_acknowledges(monkeypatch: pytest.MonkeyPatch) -> None:
    with motorbus.simulate("kst", ids="0x25") as sim, motorbus.open(sim.url) as bus:
        sim[0x25].unplug()
        bus.engine.diagnosis = lambda: "the adapter refused 3 frames"
        doctor = BusDoctor(bus, "arm")
        doctor.examine()
    assert [one.code for one in doctor.found] == ["adapter-no-ack"]


def no_permission(*_: object, **__: object) -> Any:
    raise errors.no_permission("/dev/ttyACM0", "/dev/ttyACM0")


def refused_rate(*_: object, **__: object) -> Any:
    raise errors.unsupported_rate("/dev/ttyACM0", 1_000_000, "invalid argument")


def refused(*_: object, **__: object) -> Any:
    raise LinkError("can0 cannot be opened: unknown reason")


def held_by_brltty(*_: object, **__: object) -> Any:
    raise errors.busy("/dev/ttyUSB0", Owner(7, "brltty"))


@pytest.mark.parametrize(
    ("opened", "code"),
    [
        (no_permission, "port-permission"),
        (refused_rate, "rate-refused"),
        (refused, "port-refused"),
        (held_by_brltty, "brltty"),
    ],
)
def test_a_port_that_cannot_be_opened(opened: Any, code: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motorbus.session.open", opened)
    (finding,) = examine.examine_bus("feetech:/dev/ttyACM0", {}).findings
    assert (finding.code, finding.severity) == (code, "error")


def test_a_missing_and_a_busy_port(monkeypatch: pytest.MonkeyPatch) -> None:
    assert examine.examine_bus("feetech:/dev/ttyNONE", {}).findings[0].code == "port-missing"
    with motorbus.simulate("feetech") as sim, motorbus.open(sim.url):
        assert examine.examine_bus(sim.url, {}).findings[0].code == "port-busy"
    monkeypatch.setattr("motorbus.doctor.examine.has_brltty", lambda: True)
    assert examine.examine_bus("feetech:/dev/ttyNONE", {}).findings[0].code == "brltty"


def test_brltty_is_found_by_its_process_and_the_adapter(tmp_path: Path) -> None:
    files = {
        "sys/bus/usb/devices/1-2/idVendor": "1a86\n",
        "sys/bus/usb/devices/1-2/idProduct": "7523\n",
        "proc/7/comm": "brltty\n",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert examine.has_brltty(tmp_path / "sys", tmp_path / "proc")
    assert not examine.has_brltty(tmp_path / "sys", tmp_path)


def test_a_failed_check_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    with motorbus.simulate("feetech") as sim:
        monkeypatch.setattr("motorbus.families.feetech.checks.diagnosis.REGISTERS", 300)
        assert examine.examine_bus(sim.url, {}).findings[0].code == "check-failed"


# -- the first error explains later ones -----------------------------------------------------------------------


def test_the_first_error_explains_later_ones_of_the_same_device() -> None:
    with motorbus.simulate("feetech", ids="1-3") as sim:
        sim[2].voltage, sim[2].temperature, sim[3].temperature = 12.0, 85.0, 85.0
        supply, hot = examine.examine_bus(sim.url, {}).findings
    assert (supply.code, hot.code, hot.where.count("#")) == ("supply-out-of-range", "too-hot", 2)
    assert hot.because == "supply-out-of-range"


# -- read only -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "order", ["enable_torque", "move", "write", "stop", "disable_torque", "reg_write", "set_id"]
)
def test_a_read_only_bus_refuses_all_that_changes_a_device(order: str) -> None:
    arguments: dict[str, Any] = {"move": {"to": 3.0}, "write": {"acceleration": 1.0}, "set_id": {"new": 9}}
    arguments["reg_write"] = {"goal_position": 3.0}
    with simulated(Scenario(title="", code="")) as (sim, sent), motorbus.open(sim.url) as bus:
        bus.read_only = True
        servo = motorbus.feetech.Servo(bus, 1)
        with pytest.raises(RequestError, match="only reads"):
            getattr(servo, order)(**arguments.get(order, {}))
        assert servo.position() > 0
        assert all(only_reads(data, "feetech") for data in sent)


def test_an_emergency_stop_leaves_a_read_only_bus() -> None:
    with simulated(Scenario(title="", code="")) as (sim, sent), motorbus.open(sim.url) as bus:
        sim[1].memory["torque_enable"] = 1
        bus.read_only = True
        bus.estop()
        assert sim[1].memory["torque_enable"] == 0
        assert not all(only_reads(data, "feetech") for data in sent)


# -- move, explain, page, bundle, shell ------------------------------------------------------------------------


def test_a_small_movement_shows_a_blocked_shaft() -> None:
    with motorbus.simulate("feetech", ids="1-2") as sim, motorbus.Robot.at(f"{sim.url}#1-2") as robot:
        sim[2].block_shaft()
        (finding,) = move_axes(robot)
        assert (finding.code, finding.where) == ("motion-blocked", "#2")
        assert [sim[id].memory["torque_enable"] for id in (1, 2)] == [0, 0]
        assert abs(sim[1].raw_position - 2048) < 5


MESSAGES = """\
Failed to sync read 'Present_Position' on ids=[1, 2, 3]. [TxRxResult] There is no status packet!|replies-lost
ValueError: Magnitude 2114 exceeds 2047 (max for sign_bit_index=11)|calibration-wrap
RuntimeError: FeetechMotorsBus motor check failed on port '/dev/ttyACM0'|device-missing
RuntimeError: Some motors use different firmware versions|firmware-mixed
[RxPacketError] Input voltage error!|supply-out-of-range
[RxPacketError] Overload error!|overload-latched
[TxRxResult] Incorrect status packet!|line-noise
[Errno 13] could not open port /dev/ttyACM0: [Errno 13] Permission denied: '/dev/ttyACM0'|port-permission
FileNotFoundError: [Errno 2] No such file or directory: '/dev/ttyACM1'|port-missing
SerialException: device reports readiness to read but returned no data (device disconnected?)|port-lost
OSError: [Errno 16] Device or resource busy: '/dev/ttyUSB0'|port-busy
termios.error: (22, 'Invalid argument')|rate-refused
Mismatch between calibration values in the motor and the calibration file|calibration-differs
thread 'main' panicked: Custom { kind: TimedOut, error: "Operation timed out" }|replies-lost
can.exceptions.CanOperationError: Failed to transmit: No buffer space available [Error Code 105]|adapter-no-ack
canopen.sdo.exceptions.SdoCommunicationError: No SDO response received|can-silent
can.exceptions.CanInitializationError: Could not set bitrate|rate-refused
WARNING Record loop is running slower (21.3 Hz) than the target FPS (30 Hz)|loop-too-fast"""


@pytest.mark.parametrize("row", MESSAGES.splitlines())
def test_a_message_is_explained(row: str) -> None:
    text, _, code = row.rpartition("|")
    (finding,) = explain(f"Traceback (most recent call last):\n  File x, line 3\n{text}\n")
    assert (finding.code, finding.where) == (code, "line 3")
    assert text[:40] in finding.evidence


def doctor(*words: str) -> int:
    return main(["doctor", *words])


def test_the_shell(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with motorbus.simulate("feetech", ids="1-3") as sim:
        assert doctor(sim.url, "--loop", "50") == 0
        assert "loop-rate" in capsys.readouterr().out
        sim[2].voltage = 12.0
        words = ("--json", "--html", "a.html", "--bundle", "a.zip")
        assert doctor(f"{sim.url}#1-4", *words) == 1
        captured = capsys.readouterr()
    report = json.loads(captured.out)
    assert [one["code"] for one in report["findings"]] == ["supply-out-of-range", "device-missing"]
    assert json.loads(captured.err)["exit"] == 1
    page = (tmp_path / "a.html").read_text()
    assert "supply 12.0 V, limits of the servo 4.0 to 8.0 V" in page
    assert "http" not in page
    with zipfile.ZipFile(tmp_path / "a.zip") as file:
        assert [name.partition("-")[0] for name in file.namelist()] == [
            "findings.json",
            "versions.json",
            "trace",
        ]
        assert " tx FF FF 01 04 02" in file.read(file.namelist()[2]).decode()
        assert str(Path.home()) not in file.read("findings.json").decode()


def test_the_shell_asks_before_it_moves_and_explains_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with motorbus.simulate("feetech", ids="1-2") as sim:
        assert doctor(sim.url, "--move") == 8
        assert sim[1].memory["torque_enable"] == 0
        sim[1].block_shaft()
        assert doctor(sim.url, "--move", "--yes") == 1
        assert "motion-blocked" in capsys.readouterr().out
    (tmp_path / "log.txt").write_text(MESSAGES)
    assert doctor("--explain", "log.txt") == 0
    assert capsys.readouterr().out.startswith("error    loop-too-fast  line 18")
    assert doctor() == 2


# -- codes -----------------------------------------------------------------------------------------------------


def test_every_code_has_a_scenario_and_a_section() -> None:
    source = Path(__file__).read_text()
    staged = {one.code for one in SCENARIOS} | {code for code in CODES if f'"{code}"' in source}
    assert set(CODES) - staged == set()
    page = Path("docs/reference/doctor.md").read_text()
    assert [line[4:] for line in page.splitlines() if line.startswith("### ")] == list(CODES)


def test_a_bus_of_the_machine_file_is_examined_with_its_axes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with motorbus.simulate("feetech", ids="1-2") as sim:
        buses = f'[bus.arm]\naddress = "{sim.url}"\n[bus.other]\naddress = "kst:/dev/ttyNONE"\n'
        (tmp_path / "motorbus.toml").write_text(f"format = 1\n{buses}{axes('1+2+3')}")
        assert doctor("arm") == 5
        assert "device-missing  a3" in capsys.readouterr().out
        assert doctor("leg") == 2
