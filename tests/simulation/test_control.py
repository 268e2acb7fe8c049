"""Orders over a local socket: answered in one line each, refused in one line, and for the owner alone."""

from __future__ import annotations

import json
import os
import socket
import stat
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from motorbus.errors import LinkError, PortBusy, RequestError
from motorbus.families.feetech.simulator import simulate
from motorbus.families.stepper import simulator as stepper
from motorbus.simulation.control import HELP, LONGEST_LINE, MOST_CLIENTS, ControlSocket, obey
from motorbus.simulation.faulted import Faulted
from motorbus.simulation.faults import World
from motorbus.simulation.listener import TcpListener
from motorbus.simulation.mount import Mount
from tests.support.mounts import asked, served


@pytest.fixture
def path() -> Iterator[Path]:
    with TemporaryDirectory() as folder:  # a short name: local sockets allow some hundred bytes
        yield Path(folder) / "control"


def order(path: Path, text: str) -> str:
    """Send an order from a client of its own and read one line."""
    with socket.socket(socket.AF_UNIX) as client:
        client.settimeout(10.0)
        client.connect(os.fspath(path))
        client.sendall(text.encode() + b"\n")
        with client.makefile() as lines:
            return lines.readline().rstrip("\n")


def test_orders_while_the_bus_is_served(path: Path) -> None:
    bus = simulate((1, 2))
    control = ControlSocket(path, bus)
    with (
        closing(control),
        closing(TcpListener()) as listener,
        served(Mount(bus, listener, attendants=[control])),
        socket.create_connection((listener.host, listener.port)) as client,
    ):
        assert asked(client.fileno(), "FF FF 02 04 03 29 09 C4", 6) == "FF FF 02 02 00 FB"
        assert order(path, "unplug 2") == "ok"
        status = json.loads(order(path, "status"))
        assert [status["schema"], status["simulated"]] == ["motorbus.simulator/1", True]
        assert [(node["id"], node["plugged"]) for node in status["nodes"]] == [(1, True), (2, False)]
        assert order(path, "plug 2") == "ok"
        assert asked(client.fileno(), "FF FF 02 04 02 29 01 CD", 7) == "FF FF 02 03 00 00 FA"  # RAM is lost


def test_power_cycle_of_one_and_of_all() -> None:
    bus = simulate((1, 2))
    for servo in bus.servos:
        servo.memory["acceleration"] = 9
    assert obey(bus, "power-cycle 2") == "ok"
    assert [servo.memory["acceleration"] for servo in bus.servos] == [9, 0]
    assert obey(bus, "power-cycle") == "ok"
    assert [servo.memory["acceleration"] for servo in bus.servos] == [0, 0]


def test_help_names_every_order() -> None:
    bus = stepper.simulate((1,))  # it has inputs, and all else that any other has
    world = World(bus)
    faults = Faulted(Mount(world), world)
    for word in obey(bus, "help").split(" | "):
        order = word.replace("[ID]", "").replace("ID", "1").replace("INPUT on|off", "2 on")
        order = order.replace("[SCRIPT|off]", "off")
        order = order.replace("[LOW HIGH]", "").replace("ANGLE", "30deg").replace("PERCENT", "50%")
        order = order.replace("VOLTS", "7.4").replace("DEGREES", "40")
        answer = obey(bus, order, faults)
        assert not answer.startswith("error") or "has no physics for" in answer


def test_faults_are_set_looked_at_and_switched_off() -> None:
    bus = simulate((1,))
    world = World(bus)
    faults = Faulted(Mount(world), world)
    assert obey(bus, "faults exchange 2: drop; 100% of bytes: flip 0", faults) == "ok"
    facts = json.loads(obey(bus, "faults", faults))
    assert (facts["schema"], facts["simulated"], facts["count"]) == ("motorbus.simulator-script/1", True, 0)
    assert facts["script"] == f"seed {facts['seed']}; exchange 2: drop; 100% of bytes: flip 0"
    assert obey(bus, "faults exchange 1: explode", faults).startswith("error: line 1: ")
    assert json.loads(obey(bus, "faults", faults)) == facts
    assert obey(bus, "faults off", faults) == "ok"
    assert json.loads(obey(bus, "faults", faults))["script"] == ""
    assert obey(bus, "faults", None) == "error: this simulation takes no faults"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "error: '' is not an order; there are: status"),
        ("explode", "error: 'explode' is not an order"),
        ("unplug", "error: the order is: unplug ID"),
        ("plug 1 2", "error: the order is: plug ID"),
        ("status now", "error: the order is: status"),
        ("power-cycle 1 2", "error: the order is: power-cycle [ID]"),
        ("set-input 1 2 on", "error: node 1 has no inputs"),
        ("block 1 90deg", "error: the order is: block ID [LOW HIGH]"),
        ("block 1 10deg 20deg", "error: the shaft is at 3.1416 rad (180.0°); expected a range that contains"),
        ("push 1", "error: the order is: push ID ANGLE"),
        ("push 1 30", "error: 30 has no unit; expected a number with its unit, as 30deg or 0.5rad"),
        ("push 1 9999deg", "error: 174.5155 rad (9999.0°) is too far; expected at most 10 turns"),
        ("push 1 30V", "error: position '30V' has the unit 'V'"),
        ("load 1 0.5", "error: 0.5 has no unit; expected a number with its unit, as 50%"),
        ("load 1 101%", "error: 101% is not possible; expected -100% to 100%"),
        ("release", "error: the order is: release ID"),
        ("unplug 9", "error: there is no node 9; there are: 1, 3"),
        ("unplug one", "error: there is no node one"),
    ],
)
def test_a_bad_order_gets_one_clear_line(text: str, says: str) -> None:
    answer = obey(simulate((1, 3)), text)
    assert answer.startswith(says)
    assert "\n" not in answer


def test_ids_may_be_hexadecimal() -> None:
    bus = simulate((16,))
    assert obey(bus, "unplug 0x10") == "ok"
    assert not bus.nodes[16].plugged


# The socket itself.


def pumped(control: ControlSocket) -> None:
    """Attend to everything that is readable or has room, until nothing is."""
    import select

    while any(ready := select.select(control.descriptors(), control.stuck(), (), 0.0)):
        for descriptor in (*ready[0], *ready[1]):
            control.attend(descriptor)


def connected(path: Path) -> socket.socket:
    client = socket.socket(socket.AF_UNIX)
    client.settimeout(10.0)
    client.connect(os.fspath(path))
    return client


def test_it_is_for_its_owner_alone_and_goes_when_closed(path: Path) -> None:
    control = ControlSocket(path, simulate((1,)))
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    control.close()
    control.close()
    assert not path.exists()


def test_several_orders_in_one_piece_and_one_order_in_several(path: Path) -> None:
    with closing(ControlSocket(path, simulate((1,)))) as control, closing(connected(path)) as client:
        client.sendall(b"unplug 1\nplug 1\nexpl")
        pumped(control)
        assert client.recv(100) == b"ok\nok\n"
        client.sendall(b"ode\n")
        pumped(control)
        assert client.recv(100).startswith(b"error: 'explode'")


def test_bytes_that_are_no_text(path: Path) -> None:
    with closing(ControlSocket(path, simulate((1,)))) as control, closing(connected(path)) as client:
        client.sendall(b"\xff\xfe\n")
        pumped(control)
        assert client.recv(200).startswith(b"error: ")


@pytest.mark.parametrize("size", [LONGEST_LINE + 1, 3 * LONGEST_LINE])
def test_an_order_that_is_too_long_is_refused_once_and_the_next_one_carried_out(
    size: int, path: Path
) -> None:
    """Whoever is hung up on while he still writes never sees the answer."""
    with closing(ControlSocket(path, simulate((1,)))) as control, closing(connected(path)) as client:
        for _ in range(size // 8192):
            client.sendall(b"x" * 8192)
            pumped(control)
        client.sendall(b"x" * (size % 8192) + b"\nunplug 1\n")
        pumped(control)
        assert client.recv(200) == b"error: an order has at most 65536 bytes; nothing has changed\nok\n"


def test_an_answer_longer_than_a_socket_takes_at_once_arrives_whole(path: Path) -> None:
    bus = simulate((1,))
    world = World(bus)
    script = "; ".join(f"exchange {number}: drop" for number in range(20_000))
    with (
        closing(ControlSocket(path, bus)) as control,
        closing(TcpListener()) as listener,
    ):
        mount = Mount(world, listener, attendants=[control])
        control.faults = Faulted(mount, world)
        control.faults.set(script)
        with served(mount):
            answer = order(path, "faults")
            assert len(answer) > 1 << 18, "more than the system keeps for a reader"
            assert json.loads(answer)["script"] == script
            assert order(path, "unplug 1") == "ok"


def test_who_does_not_read_waits_and_holds_nobody_up(path: Path) -> None:
    with (
        closing(ControlSocket(path, simulate(tuple(range(100))))) as control,
        closing(connected(path)) as lazy,
        closing(connected(path)) as other,
    ):
        lazy.sendall(b"status\n" * 99 + b"help\n" + b"unplug 7\nunplug")
        lazy.shutdown(socket.SHUT_WR)
        pumped(control)
        assert len(control.stuck()) == 1
        other.sendall(b"plug 1\n")
        pumped(control)
        assert other.recv(100) == b"ok\n"
        said = b""
        while part := lazy.recv(1 << 20):
            said += part
            pumped(control)
        *stati, last, end, nothing = said.decode().split("\n")
        assert [json.loads(one)["schema"] for one in stati] == ["motorbus.simulator/1"] * 99
        assert (last, end, nothing) == (HELP, "ok", "")
        assert (len(control.descriptors()), control.stuck()) == (2, [])


def test_too_many_clients_are_sent_away(path: Path) -> None:
    with closing(ControlSocket(path, simulate((1,)))) as control:
        clients = []
        for _ in range(MOST_CLIENTS + 1):
            clients.append(connected(path))
            pumped(control)
        assert len(control.descriptors()) == MOST_CLIENTS + 1
        assert clients[-1].recv(1) == b""
        for client in clients:
            client.close()


def test_what_a_dead_simulator_left_is_taken_over(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(os.fspath(path))
    with closing(ControlSocket(path, simulate((1,)))):
        assert path.exists()


def test_a_live_one_is_busy_and_not_disturbed(path: Path) -> None:
    with closing(ControlSocket(path, simulate((1,)))):
        with pytest.raises(PortBusy):
            ControlSocket(path, simulate((1,)))
        assert path.exists()


def test_another_file_is_not_removed(path: Path) -> None:
    path.write_text("mine")
    with pytest.raises(RequestError, match="no socket"):
        ControlSocket(path, simulate((1,)))
    assert path.read_text() == "mine"


def test_a_folder_that_is_not_there_and_a_path_too_long(path: Path) -> None:
    with pytest.raises(LinkError):
        ControlSocket(path / "missing" / "control", simulate((1,)))
    with pytest.raises(RequestError):
        ControlSocket(path.with_name("x" * 200), simulate((1,)))
