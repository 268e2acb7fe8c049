"""A writer that is kept gives the packet that `sync_write` would make, or its error, and nothing half-made."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import motorbus
from motorbus import feetech
from motorbus.core.aimed import Aimed
from motorbus.core.operation import Exchange
from motorbus.errors import LimitExceeded, MotorbusError, RequestError
from motorbus.families.feetech.driver import Node, sync_write_positions, sync_writer
from motorbus.families.feetech.driver import mould as of_mould
from motorbus.families.feetech.driver import writer as of_writer
from motorbus.families.feetech.driver.writer import SyncWriter
from motorbus.families.feetech.table import TABLES
from tests.families.feetech.driver_script import Line, packet, play
from tests.families.feetech.maps import HEADS, met
from tests.families.feetech.test_driver_mould import NAMES, NUMBERS, TIMES, fully

EVERY_NAME = sorted({name for table in TABLES.values() for name in table})


def told(make: Any) -> tuple[Any, ...] | str:
    """What an order says; the words of the error where it is refused."""
    try:
        order = make()
    except MotorbusError as error:
        return str(error)
    assert isinstance(order, Exchange)
    return order.request, repr(order.goals), order.effect, order.rank, order.replies


@given(st.lists(st.sampled_from(list(HEADS)), min_size=1, max_size=3), st.data())
def test_one_register_of_any_maps_is_written_as_sync_write_does(
    names: list[str], draw: st.DataObject
) -> None:
    nodes = [met(name, id) for id, name in enumerate(names, 1)]
    write = sync_writer(nodes, "goal_position")
    for _ in range(2):
        values = [draw.draw(NUMBERS) for _ in nodes]
        full = fully(nodes, ["goal_position"], [[value] for value in values])
        expected = full if isinstance(full, str) else told(lambda full=full: full)
        assert told(lambda values=values: write(values)) == expected
        assert told(lambda values=values: write(tuple([value] for value in values))) == expected


@given(st.lists(st.sampled_from(("sts", "smcl", "scs")), min_size=1, max_size=3), st.data())
def test_several_registers_are_written_as_sync_write_does(names: list[str], draw: st.DataObject) -> None:
    nodes = [met(name, id) for id, name in enumerate(names, 1)]
    rows = [[draw.draw(NUMBERS), draw.draw(TIMES), draw.draw(NUMBERS)] for _ in nodes]
    full = fully(nodes, NAMES, rows)
    expected = full if isinstance(full, str) else told(lambda: full)
    assert told(lambda: sync_writer(nodes, *NAMES)(rows)) == expected


WRONG: list[Any] = [
    {1: 1.0, 2: 2.0},
    {0.5: 1.0, 0.6: 2.0},
    {0.5, 0.6},
    "12",
    b"12",
    None,
    1.0,
    iter([1.0, 2.0]),
    [],
    [1.0],
    [1.0, 2.0, 3.0],
    [1.0, [2.0, 3.0]],
    [[1.0], []],
    [1.0, {"goal_position": 2.0}],
    [[[1.0]], [[2.0]]],
    [1.0, None],
    [1.0, "2"],
    [1.0, True],
    [1.0, nan],
    [inf, 1.0],
    [1.0, 10**400],
    [1.0, 1e300],
]


@pytest.mark.parametrize("values", WRONG, ids=lambda one: repr(one)[:20])
@pytest.mark.parametrize("name", ["sts", "scs"])
def test_what_is_no_row_of_goals_is_one_clear_error(name: str, values: Any) -> None:
    write = sync_writer([met(name, 1), met(name, 2)], "goal_position")
    before = told(lambda: write([1.0, 2.0]))
    with pytest.raises((RequestError, LimitExceeded)) as caught:
        write(values)
    assert "nothing was sent" in caught.value.advice
    assert told(lambda: write([1.0, 2.0])) == before


@pytest.mark.parametrize(
    "values", [[[1.0, 0.0]], [[1.0, 0.0, 0.0, 0.0]], [1.0, 0.0, 0.0], ["abc"], {1: NAMES}, [None]]
)
def test_rows_of_another_length_are_refused(values: Any) -> None:
    with pytest.raises(RequestError) as caught:
        sync_writer([met("sts", 1)], *NAMES)(values)
    assert "nothing was sent" in caught.value.advice


@pytest.mark.parametrize("positions", [{1: 1.0, 2: 2.0}, {0.5, 0.6}, "12", b"12", None, 1.0])
def test_positions_that_have_no_order_are_refused_too(positions: Any) -> None:
    with pytest.raises(RequestError, match="no row of values"):
        sync_write_positions([met("sts", 1), met("sts", 2)], positions)


class Odd(list[float]):
    """Another number of values is in it than it says."""

    given: tuple[float, ...] = ()

    def __iter__(self) -> Iterator[float]:
        return iter(self.given)


@pytest.mark.parametrize(
    "row", [dict.fromkeys((1.0, 5.0, 0.5)), {1.0, 5.0, 0.5}, frozenset((1.0, 5.0, 0.5)), None, 1.0]
)
def test_a_row_without_an_order_is_refused_whatever_is_in_it(row: Any) -> None:
    write = sync_writer([met("sts", 1), met("sts", 2)], *NAMES)
    with pytest.raises(RequestError, match="is no row of values"):
        write([row, [1.0, 5.0, 0.5]])


def test_no_value_moves_to_a_neighbour() -> None:
    write = sync_writer([met("sts", 1), met("sts", 2)], *NAMES)
    more, less = Odd([1.0, 5.0, 0.5]), Odd([1.0, 5.0, 0.5])
    more.given, less.given = (1.0, 5.0, 0.5, 2.0), (6.0, 0.6)
    with pytest.raises((RequestError, ValueError)):
        write([more, less])


@pytest.mark.parametrize("kept", [True, False])
def test_settings_that_another_thread_sets_meanwhile_never_make_wrong_bytes(
    monkeypatch: pytest.MonkeyPatch, kept: bool
) -> None:
    node, other = met("sts", 1), met("sts", 1, at_30=2).settings
    write = sync_writer([node], "goal_position")
    module, name = (of_mould, "_cell") if kept else (of_writer, "block_of")
    plain = getattr(module, name)

    def meanwhile(*its: Any) -> Any:
        found = plain(*its)
        node.settings = other
        return found

    monkeypatch.setattr(module, name, meanwhile)
    order = write([1.0 if kept else 1])
    monkeypatch.undo()
    assert order.refusal is not None
    assert order.refusal(lambda _: 0) is not None or told(lambda: order) == told(
        lambda: sync_write_positions([node], [1.0])
    )
    assert told(lambda: write([1.0])) == told(lambda: sync_write_positions([node], [1.0]))


def test_who_is_not_prepared_does_not_heed_it_or_is_named_twice_is_refused() -> None:
    with pytest.raises(RequestError, match="not prepared"):
        sync_writer([Node(1)], "goal_position")([1.0])
    with pytest.raises(RequestError, match="operating mode velocity"):
        sync_writer([met("sts", 1, operating_mode=1)], "goal_position")([1.0])
    with pytest.raises(RequestError, match="named twice"):
        sync_writer([met("sts", 1), met("sts", 1)], "goal_position")
    with pytest.raises(RequestError, match="no register is named"):
        sync_writer([met("sts", 1)])
    with pytest.raises(RequestError, match="goal_positon"):
        sync_writer([met("sts", 1)], "goal_positon")
    many = [met("sts", id) for id in range(84)]
    with pytest.raises(RequestError, match="one packet cannot carry"):
        sync_writer(many, "goal_position")([1.0] * 84)


def test_it_follows_the_settings_that_its_servos_have_now() -> None:
    nodes = [met("sts", 1), met("sts", 2)]
    write = sync_writer(nodes, "goal_position")
    assert isinstance(write([1.0, 1.0]), Aimed)
    assert isinstance(write([1.0, 1.0]), Aimed)  # by now it has found that nothing has changed
    nodes[1].settings = met("sts", 2, at_30=2).settings
    again = write([1.0, 1.0])
    assert told(lambda: again) == told(lambda: sync_write_positions(nodes, [1.0, 1.0]))
    nodes[1].forget_settings()
    with pytest.raises(RequestError, match="not prepared"):
        write([1.0, 1.0])
    nodes[1].settings = met("sts", 2, operating_mode=1).settings
    with pytest.raises(RequestError, match="operating mode velocity"):
        write([1.0, 1.0])
    nodes[1].settings = met("sts", 2).settings
    assert isinstance(write([1.0, 1.0]), Aimed)


def test_bytes_typed_by_hand() -> None:
    little, big = sync_writer([met("sts", 1)], *NAMES), sync_writer([met("scs", 1)], *NAMES)
    count = 0.0015339807878856412
    play(
        little([[2048 * count, 5.0, 300 * count]]),
        Line(packet(254, 0x83, 42, 6, 1, 0, 8, 5, 0, 0x2C, 1), None),
    )
    count = 0.0051132692929521375
    play(big([[512 * count, 5.0, 300 * count]]), Line(packet(254, 0x83, 42, 6, 1, 2, 0, 0, 5, 1, 0x2C), None))


def test_servos_on_a_bus_go_where_they_are_told_and_nowhere_else() -> None:
    with motorbus.simulate("feetech", ids="1-2") as sim, motorbus.open(sim.url) as bus:
        servos = [feetech.Servo(bus, id) for id in (1, 2)]
        bus.run(feetech.prepare_all(servos))
        write = feetech.sync_writer(servos, "goal_position")
        bus.run(write([3.0, 3.1]))
        goals = [servo.read("goal_position")["goal_position"] for servo in servos]
        assert goals == pytest.approx([3.0, 3.1], abs=0.002)
        with pytest.raises(LimitExceeded):
            bus.run(write([3.0, 6.4]))
        assert [servo.read("goal_position")["goal_position"] for servo in servos] == goals


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("goal_position", "goal_position"), "named twice: goal_position, goal_position"),
        (("goal_position", "goal_time", "goal_position"), "named twice"),
        (("present_position",), "can only be read"),
        (("goal_position", "present_position"), "can only be read"),
        (("id",), "would change how the servo is found"),
        (("homing_offset",), "may not be copied"),
        (("max_torque",), "adjoining RAM registers only, not max_torque"),
        (
            ("goal_position", "goal_velocity"),
            "adjoining RAM registers only, not goal_position, goal_velocity",
        ),
        ((5,), "5 is no name of a register"),
        ((["goal_position"],), "is no name of a register"),
    ],
)
def test_what_could_never_be_written_is_refused_when_it_is_made(names: Any, words: str) -> None:
    with pytest.raises(RequestError, match=words) as caught:
        sync_writer([met("sts", 1), met("sts", 2)], *names)
    assert "nothing was sent" in caught.value.advice


@pytest.mark.parametrize(
    "names", [("present_position",), ("id",), ("max_torque",), ("goal_position", "goal_velocity")]
)
def test_of_those_who_are_not_prepared_it_is_found_out_at_the_first_call(names: tuple[str, ...]) -> None:
    """And it is said in the same words."""
    node = Node(1)
    write = sync_writer([node], *names)
    row = 1.0 if len(names) == 1 else [1.0, 1.0]
    with pytest.raises(RequestError, match="not prepared|can only be read|how the servo is found"):
        write([row])
    known = met("sts", 1)
    node.identity, node.table, node.settings = known.identity, known.table, known.settings
    with pytest.raises(RequestError) as late:
        write([row])
    with pytest.raises(RequestError) as early:
        sync_writer([known], *names)
    assert early.value.summary == late.value.summary


@given(
    st.sampled_from(list(HEADS)), st.lists(st.sampled_from(EVERY_NAME), min_size=1, max_size=3, unique=True)
)
def test_whatever_could_be_written_may_be_made(name: str, names: list[str]) -> None:
    """What is refused when it is made would be refused with any value."""
    node = met(name, 1)
    bound = node.bound
    try:
        sync_writer([node], *names)
    except RequestError:
        for value in (0.0, 1.0, 2.0, 40.0, 1000.0):
            row = value if len(names) == 1 else [value] * len(names)
            with pytest.raises(MotorbusError):
                SyncWriter([node], names)([row])
    else:
        assert node.bound == bound, "it changes nothing of what is known"


@pytest.mark.parametrize("servos", [None, 5, met("sts", 1)])
def test_what_is_no_list_of_servos_is_refused(servos: Any) -> None:
    with pytest.raises(RequestError, match="is no list of servos") as caught:
        sync_writer(servos, "goal_position")
    assert "nothing was sent" in caught.value.advice
