"""Everything that can be wrong with a request: one clear error, its own exit code, and nothing changed.

That nothing was changed is seen at the simulated devices: in what the bus hears, and in every register of a device.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from motorbus.core.request import Data
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Bench, Run
from tests.cli.test_estop import FOREIGN, WATCHING, program
from tests.support.processes import Simulated

pytestmark = pytest.mark.usefixtures("state_folder")


PING, READ, WRITE, SYNC_READ = 1, 2, 3, 0x82


def registers(arm: Simulation) -> dict[str, int]:
    """Every register of servo 1."""
    return {name: arm[1].memory[name] for name in arm.family.registers["sts"]}


def listening(arm: Simulation, monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """From here on, every packet that the simulated bus hears."""
    heard: list[bytes] = []
    receive = arm.simulator.receive

    def overheard(data: Data, at: float) -> None:
        assert isinstance(data, bytes)
        heard.append(data)
        receive(data, at)

    monkeypatch.setattr(arm.simulator, "receive", overheard)
    return heard


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (["read", "feetech:/dev/no-such-port#1"], 3, "no-such-port"),
        (["read", "feetech:socket://127.0.0.1:1#1"], 3, "127.0.0.1"),
        (["read", "feetech:pigeon://coop#1"], 2, "pigeon"),
        (["read", "feetech:sim:nobody#1"], 3, "nobody"),
        (["read", "feetech:sim,model=abacus#1"], 2, "abacus"),
        (["scan", "nobody:/dev/ttyACM0"], 2, "nobody"),
        (["scan", "feetech:sim,baud=fast"], 2, "fast"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else str(value),
)
def test_a_bus_that_cannot_be_opened(words: list[str], code: int, told: str, run: Run) -> None:
    ran = run(*words)
    assert (ran.code, ran.out) == (code, "")
    assert ran.err.startswith("error: ")
    assert told in ran.err


def test_a_port_that_another_motorbus_process_holds(served: Simulated, run: Run) -> None:
    with program(WATCHING, served.bus) as process:
        ran = run("read", f"{served.bus}#1")
    assert ran.code == 4
    assert str(process.pid) in ran.err


def test_a_port_that_a_foreign_program_holds(served: Simulated, run: Run) -> None:
    with program(FOREIGN, served.bus.partition(":")[2]) as process:
        ran = run("read", f"{served.bus}#1")
    assert ran.code == 4
    assert str(process.pid) in ran.err


def test_a_port_that_vanishes_meanwhile(tmp_path: Path) -> None:
    with Simulated("feetech", ids="1", link=tmp_path / "bus") as simulated:
        command = [
            sys.executable,
            "-m",
            "motorbus",
            "monitor",
            f"{simulated.bus},reconnect=no#1",
            "--rate",
            "1000",
            "--json",
        ]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as watching:
            assert watching.stdout is not None
            assert watching.stderr is not None
            assert watching.stdout.readline()
            simulated.end()
            watching.stdout.read()
            told = watching.stderr.read()
            assert watching.wait(timeout=30) == 3, told
    assert '"LinkLost"' in told


def test_a_wrong_rate_is_silence_with_advice(served: Simulated, run: Run) -> None:
    ran = run("read", f"{served.bus},baud=500000#1")
    assert ran.code == 5
    assert "--baud all" in ran.err


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["read", "BUS#254", "present_position"], 2),
        (["read", "BUS#1", "present_positon"], 2),
        (["write", "BUS#1", "id=254", "--yes"], 2),
        (["write", "BUS#254", "goal_position=1"], 2),
        (["write", "BUS#1", "goal_position=nan"], 2),
        (["write", "BUS#1", "torque_limit=101%"], 2),
        (["move", "BUS#1=nan"], 2),
        (["move", "BUS#254=1"], 2),
        (["move", "BUS#1=7", "--yes"], 8),
        (["torque", "off", "BUS#254"], 2),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else str(value),
)
def test_a_request_that_is_impossible_changes_nothing(
    words: list[str], code: int, run: Run, arm: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = arm[1].status(), registers(arm)
    heard = listening(arm, monkeypatch)
    ran = run(*(word.replace("BUS", arm.url) for word in words))
    assert (ran.code, ran.out) == (code, "")
    assert ran.err.startswith("error: ")
    assert ran.err.count("error: ") == 1
    assert (arm[1].status(), registers(arm)) == before
    assert {packet[4] for packet in heard} <= {PING, READ}


def test_what_is_possible_is_heard(run: Run, arm: Simulation, monkeypatch: pytest.MonkeyPatch) -> None:
    before = registers(arm)
    heard = listening(arm, monkeypatch)
    assert run("write", f"{arm.url}#1", "torque_limit=50%").code == 0
    assert {packet[4] for packet in heard} > {WRITE}
    assert registers(arm) != before


AXES = [
    ("move a1=nan", 2),
    ("move a1=151deg", 8),
    ("move a1=10deg a2=-151deg", 8),
    ("move upper=1 a1=1", 2),
    ("move lift=1mm", 8),
    ("move a1=10deg --duration 1ms", 2),
    ("pose redy", 2),
    ("pose whole", 8),
    ("park a2", 2),
    ("jog a1=900deg/s --seconds 1", 8),
    ("jog a1=30deg/s --seconds 60", 8),
    ("hold a9", 2),
    ("home a1", 2),
    ("torque on a9", 2),
    ("stop a9", 2),
    ("write a1 goal_position=nan", 2),
    ("read a1 present_positon", 2),
]


@pytest.mark.parametrize(("command", "code"), AXES)
def test_a_request_by_names_that_is_impossible_changes_nothing(
    command: str, code: int, run: Run, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm = bench.simulations["arm"]
    assert run("read", "a1").code == 0  # what a read refreshes is no change
    before = arm[1].status(), registers(arm)
    heard = listening(arm, monkeypatch)
    ran = run(*command.split(), "--yes")
    ran = run(*command.split()) if "--yes" in ran.err else ran
    assert (ran.code, ran.out) == (code, "")
    assert ran.err.count("error: ") == 1
    assert (arm[1].status(), registers(arm)) == before
    assert {packet[4] for packet in heard} <= {PING, READ, SYNC_READ}
