"""A machine file with a mistake in it does not take the stop away: what can be seen in it is stopped."""

from __future__ import annotations

import json
from collections.abc import Callable

import pytest

from motorbus.cli.rough import Rough, rough
from tests.cli.conftest import Bench, Run

HALF = """
format =
[bus.arm]
address = "feetech:COM7"  # left
[bus.lift
address = 'stepper:\\\\.\\COM10'
[axis.a1]
device = "arm#1"
low = "90 dog"
[axis.a2]
device = "arm#2
[axis.a3]
exit = "hold
device = 'arm#3'
[axis.a4]
device = arm
[axis.a5]
device = "leg#5"
[axis.lift]
device = "lift#1"
axis.high.device = "arm#6"
[group.both]
axes = [  # "all" of them
  "a1",
  "a2",  # the "old" one
  "a3"]
[group.open]
axes = ["a1",
  "a4"
[group.bare]
axes = ["a1" "lift"]
"""


def devices(found: Rough) -> dict[str, str]:
    return {name: axis.device for name, axis in found.machine.axes.items()}


def test_a_line_that_is_broken_costs_no_other() -> None:
    found = rough(HALF)
    assert {name: bus.address for name, bus in found.machine.buses.items()} == {
        "arm": "feetech:COM7",
        "lift": r"stepper:\\.\COM10",
    }
    assert devices(found) == {"a1": "arm#1", "a2": "arm#2", "a3": "arm#3", "lift": "lift#1"}
    assert found.machine.axes_of("both") == ("a1", "a2", "a3")
    assert found.machine.axes_of("open") == ("a1", "a4")
    assert found.machine.axes_of("bare") == ("a1", "lift")


def test_who_cannot_be_placed_is_lost_with_the_reason() -> None:
    lost = {name: error.summary for name, error in rough(HALF).lost.items()}
    assert lost == {
        "a4": "a4: the file does not say which device this axis is",
        "a5": "a5: its device is leg#5, and bus leg cannot be seen",
    }


def test_in_what_is_toml_only_the_places_count() -> None:
    found = rough("""
bus.arm.adress = "feetech:/dev/ttyACM0"
[bus.leg]
[axis]
a1 = { devise = "arm#0x1", low = [], oops = { a = 1 } }
a2 = { device = "leg#2" }
a3 = 7
Shoulder = { device = "arm#4", max_velocity = true }
[group]
left = { axes = ["a1", "a9", 3, "arm#7"] }
right = { axes = "a1, Shoulder" }
none = {}
""")
    assert devices(found) == {"a1": "arm#0x1", "Shoulder": "arm#4"}
    assert found.machine.axes_of("left") == ("a1", "a9", "arm#7")
    assert found.machine.axes_of("right") == ("a1", "Shoulder")
    assert set(found.lost) == {"leg", "a2", "a3", "a9", "none"}


@pytest.mark.parametrize(
    "text", ["", "bus = 1", "bus = [1]", "[[bus]]\na = 1", "[bus\n]", "=", "[.]\n.=", "[" * 5000]
)
def test_where_there_is_no_bus_none_is_seen(text: str) -> None:
    assert not rough(text).machine.buses


@pytest.mark.parametrize("after", ["", "oops ="], ids=["tables", "lines"])
def test_whom_an_emergency_stop_must_not_let_fall_is_kept(after: str) -> None:
    text = '[bus.arm]\naddress = "feetech:COM7"\n[axis.a1]\ndevice = "arm#1"\nestop = "hold"\n'
    axes = rough(f'{text}[axis.a2]\ndevice = "arm#2"\nestop = "hol"\n{after}').machine.axes
    assert [axis.estop for axis in axes.values()] == ["hold", None]


def test_a_whole_file_is_seen_as_it_is_read(bench: Bench) -> None:
    for text in (bench.file.read_text(encoding="utf-8"), bench.file.read_text(encoding="utf-8") + "oops ="):
        found = rough(text)
        assert found.machine.buses == bench.machine.buses
        assert found.machine.groups == bench.machine.groups
        assert devices(found) == {name: one.device for name, one in bench.machine.axes.items()}
        assert not found.lost


def swapped(old: str, new: str) -> Callable[[str], bytes]:
    """A break: this text for that, once, so that the file is another."""

    def broken(text: str) -> bytes:
        assert old in text
        return text.replace(old, new, 1).encode()

    return broken


BREAKS: dict[str, Callable[[str], bytes]] = {
    "a key that nobody knows": swapped("[axis.a2]", "[axis.a2]\noops = 1"),
    "a wrong type": swapped("[axis.a2]", "[axis.a2]\nlow = []"),
    "a unit that is none": swapped("[axis.a2]", '[axis.a2]\nhigh = "9 dogs"'),
    "no format": swapped("format = 1", ""),
    "a device misspelt": swapped('device = "arm#2"', 'devise = "arm#2"'),
    "a device twice": swapped('device = "arm#2"', 'device = "arm#1"'),
    "an axis without its device": swapped('device = "arm#2"', ""),
    "tables of another name": lambda text: text.replace("[axis.", "[axes.").encode(),
    "a quote left open": swapped('device = "arm#2"', 'device = "arm#2'),
    "a head left open": swapped("[axis.a2]", "[axis.a2"),
    "a list left open": lambda text: (text + '\n[group.new]\naxes = ["a1",\n"a2"\n').encode(),
    "a table twice": swapped("[axis.a2]", "[axis.a1]"),
    "a merge half done": swapped("[axis.a2]", "<<<<<<< mine\n=======\n[axis.a2]\n>>>>>>> yours"),
    "cut off behind its buses": lambda text: text[: text.index("[axis.") + 5].encode(),
    "another encoding": lambda text: text.encode("utf-16"),
    "a letter of another encoding": lambda text: text.encode() + b"# \xfc\n",
    "lists in lists": lambda text: (text + "oops = " + "[" * 5000).encode(),
    "bytes": lambda text: text.encode() + b"\x00\x01[\xff",
}


NOWHERE = (BREAKS["a device twice"], BREAKS["an axis without its device"])
"""Nothing in these says which device the second axis was; only the stop of its whole bus reaches it."""


@pytest.mark.parametrize("command", ["stop", "estop"])
@pytest.mark.parametrize("broken", BREAKS.values(), ids=BREAKS)
def test_everybody_on_the_buses_that_are_seen_is_stopped(
    broken: Callable[[str], bytes], command: str, bench: Bench, run: Run
) -> None:
    for node in (1, 2, 3):
        assert run("torque", "on", f"{bench.simulations['arm'].url}#{node}").code == 0
    bench.file.write_bytes(broken(bench.file.read_text(encoding="utf-8")))
    ran = run(command, "--json")
    assert ran.code == 6, ran.err
    assert "who can be seen in a file with an error" in ran.err
    if command == "stop":
        told = {(one["bus"].partition(":")[0], one["id"]) for one in ran.document["devices"] if one["done"]}
        assert told >= {("feetech", 1), ("feetech", 3), ("kst", 37), ("stepper", 1)}
        assert (("feetech", 2) in told) == (broken not in NOWHERE)
    else:
        assert [bench.simulations["arm"][node].memory["torque_enable"] for node in (1, 2, 3)] == [0, 0, 0]
        assert len([one for one in ran.document["buses"] if one["acknowledged"]]) == 3, ran.out


@pytest.mark.parametrize(
    ("words", "seen"),
    [("a1 lift", "a1, lift"), ("arm", "a1, a2, a3"), ("new", "a1, a2, a3"), ("arm#1", "arm#1")],
)
def test_whoever_is_meant_is_stopped_and_named(words: str, seen: str, bench: Bench, run: Run) -> None:
    bench.describe("\n[group.new]\naxes = [\n  'a1',\n  'a2', # two\n  'a3',\n]\noops =\n")
    ran = run("stop", *words.split(), "--json")
    assert ran.code == 6
    error = json.loads(ran.err)
    assert "who can be seen in a file with an error" in error["summary"]
    assert error["expected"] == f"all; seen were {seen}"
    assert all(one["done"] for one in ran.document["devices"])


@pytest.mark.parametrize("command", ["stop", "estop"])
def test_of_a_group_those_are_stopped_who_can_be_placed(command: str, bench: Bench, run: Run) -> None:
    text = bench.file.read_text(encoding="utf-8").replace('"arm#2"', '"arm"').replace("stepper:", "steper:")
    bench.file.write_text(
        text + '[group.some]\naxes = ["a1",\n"a2", "all", "some", "a9"]\n', encoding="utf-8"
    )
    assert run("torque", "on", f"{bench.simulations['arm'].url}#1").code == 0
    ran = run(command, "some", "--json")
    assert ran.code == 6
    for why in (
        "a2: the file does not say",
        "lift: there is no family 'steper'",
        "a9: a group names this axis",
    ):
        assert why in ran.err
    if command == "stop":
        assert [one["axis"] for one in ran.document["devices"] if one["done"]] == ["a1", "a3", "c1"]
    else:
        assert [one["acknowledged"] for one in ran.document["buses"]] == [[1, 3], [37]]


@pytest.mark.parametrize("command", ["stop", "estop"])
def test_a_bus_is_stopped_without_an_axis_that_can_be_seen(command: str, bench: Bench, run: Run) -> None:
    text = bench.file.read_text(encoding="utf-8")
    bench.file.write_text(text[: text.index("[axis.")] + "[axis.a1]\ndevice =", encoding="utf-8")
    ran = run(command, "arm", "--json")
    assert ran.code == 6
    assert "who can be seen in a file with an error" in ran.err
    if command == "stop":
        assert [one["id"] for one in ran.document["devices"] if one["done"]] == [1, 2, 3]
    else:
        assert ran.document["buses"][0]["acknowledged"]
    lost = run(command, "a1")
    assert (lost.code, lost.out) == (2, "")
    assert "a1: the file does not say which device this axis is" in lost.err


@pytest.mark.parametrize("command", ["stop", "estop"])
def test_where_nothing_is_seen_it_says_what_needs_no_file(command: str, bench: Bench, run: Run) -> None:
    bench.file.write_text("this is no machine", encoding="utf-8")
    for words in ((command, "a1"), (command,)):
        ran = run(*words)
        assert (ran.code, ran.out) == (2, "")
        assert "`motorbus stop FAMILY:PORT` and `motorbus estop FAMILY:PORT` need no file" in ran.err
        assert ran.err.count("the file is no TOML") == 1


def test_an_address_asks_no_file(bench: Bench, run: Run) -> None:
    bench.file.write_text("this is no machine", encoding="utf-8")
    arm = f"{bench.simulations['arm'].url}#1"
    assert run("stop", arm).code == 0
    beside = run("stop", arm, "a1", "--json")
    assert (beside.code, beside.document["devices"][0]["done"]) == (6, True)


def test_nothing_moves_by_such_a_file(bench: Bench, run: Run) -> None:
    bench.file.write_bytes(BREAKS["a quote left open"](bench.file.read_text(encoding="utf-8")))
    assert run("move", "a1=10deg").code == 2
    assert run("torque", "off", "a1").code == 2
