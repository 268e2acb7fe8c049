"""What survives power-off: written, read back, saved, left alone, read back again."""

from __future__ import annotations

from collections.abc import Callable
from math import radians
from typing import Any

import pytest

from motorbus.core.request import ANY, Effect, TimeoutClass
from motorbus.errors import DeviceError, OutcomeUnknown, VerificationFailed
from motorbus.families.kst import FAMILY
from motorbus.families.kst.driver.requests import write_register
from motorbus.families.kst.driver.storage import save, store
from tests.families.kst.bench import abort, bench, node, play

SAVE = "605#2210100173617665"
LIMIT = "605#220A30000CFE0000"
READ = "605#400A300000000000"
TOLD = "4b0a30000cfe0000"
OTHER = "4b0a300018fc0000"


def test_d11_a_save_expects_no_answer_and_takes_one_that_comes() -> None:
    for back in (None, "6010100100000000", ["6010100100000000"] * 2):
        play(save(node()), (SAVE, back))
    with pytest.raises(DeviceError, match="hardware error"):
        play(save(node()), (SAVE, abort(0x1010, 0x0606_0000, 1)))
    with pytest.raises(DeviceError):
        play(save(node()), (SAVE, abort(0, 0x0800_0020)))


def test_a_save_holds_its_lane_until_the_flash_is_written() -> None:
    request = save(node())
    assert (request.lane, request.expected, request.reply_within) == (5, ANY, TimeoutClass.STORE)
    assert (request.effect, request.repeatable) == (Effect.PERSISTENT, False)
    assert FAMILY.open().turnaround(request) == pytest.approx(0.170)
    with bench(ids=(5, 6)) as there:
        begun = there.link.now()
        there.servo().save()
        assert there.link.now() - begun >= 0.170
        assert there.servo().position() == 0.0
        assert there.bus.statistics.of(5).retries == 0


@pytest.mark.parametrize("reply", ["none", "ack"])
def test_the_simulator_s_ways_to_answer_a_save(reply: str) -> None:
    with bench(save_reply=reply) as there:
        there.servo().save()
    with bench(save_reply="abort") as there, pytest.raises(DeviceError):
        there.servo().save()


def test_a_write_that_fails_is_tried_three_times() -> None:
    one = node("kst-ext")
    row = one.table["negative_limit"]
    ack = "600a300000000000"
    play(
        store(one, [(row, -500)]),
        *[(READ, OTHER), *[(LIMIT, ack), (READ, OTHER)] * 2],
        *[(LIMIT, ack), (READ, TOLD), (READ, TOLD), (SAVE, None), (READ, TOLD)],
    )
    with pytest.raises(VerificationFailed, match="reads back -1000, not -500"):
        play(store(one, [(row, -500)]), (READ, OTHER), *[(LIMIT, ack), (READ, OTHER)] * 3)


def test_a_write_that_left_and_cannot_be_read_back_is_of_unknown_outcome() -> None:
    one = node("kst-ext")
    with pytest.raises(OutcomeUnknown, match="whether the write of negative_limit took effect is not known"):
        play(
            store(one, [(one.table["negative_limit"], -500)]),
            (READ, OTHER),
            (LIMIT, "600a300000000000"),
            (READ, None),
        )


def test_what_the_save_undid_is_told() -> None:
    one = node("kst-ext")
    with pytest.raises(VerificationFailed):
        play(
            store(one, [(one.table["negative_limit"], -500)]),
            *[
                (READ, OTHER),
                (LIMIT, "600a300000000000"),
                (READ, TOLD),
                (READ, TOLD),
                (SAVE, None),
                (READ, OTHER),
            ],
        )


def test_a_slow_make_is_waited_for() -> None:
    with bench(profile="xqpower") as there:
        there.sim().raw_position = 600
        begun = there.link.now()
        there.servo().set_mid_point()
        assert there.link.now() - begun >= 0.5


APPLIED: dict[str, Callable[[Any], object]] = {
    "limits": lambda servo: servo.set_travel_limits(-0.5, 0.25),
    "limits by name": lambda servo: servo.write(negative_limit=-0.5, positive_limit=0.75),
    "reverse bit": lambda servo: servo.set_reversed(True),
    "mid point": lambda servo: servo.set_mid_point(),
}


@pytest.mark.parametrize("what", APPLIED)
def test_d9_the_same_configuration_again_is_neither_written_nor_saved(what: str) -> None:
    with bench(profile="kst-ext") as there:
        there.sim().raw_position = 600
        APPLIED[what](there.servo())
        assert there.sent().count(SAVE) == 1
        APPLIED[what](there.servo())
        assert [frame for frame in there.sent() if frame[:6] == "605#22"] == []


def test_d9_what_this_node_wrote_and_did_not_save_is_written_and_saved_whatever_it_reads() -> None:
    one = node("kst-ext")
    row = one.table["negative_limit"]
    with pytest.raises(OutcomeUnknown):
        play(store(one, [(row, -500)]), (READ, OTHER), (LIMIT, "600a300000000000"), (READ, None))
    assert one.unsaved == {"negative_limit"}
    play(
        store(one, [(row, -500)]),
        *[(LIMIT, "600a300000000000"), (READ, TOLD), (READ, TOLD), (SAVE, None), (READ, TOLD)],
    )
    play(store(one, [(row, -500)]), (READ, TOLD))


def test_d9_what_others_did_not_save_cannot_be_seen_and_a_save_keeps_it() -> None:
    with bench(profile="kst-ext") as there:
        servo, stranger = there.servo(), there.servo()
        limit = servo.table["negative_limit"]
        for saves in (False, True):
            there.run(write_register(stranger, limit, -500))
            servo.write(negative_limit=radians(-50))
            if saves:
                servo.save()
            there.sim().power_cycle()
            kept = there.sim().memory["negative_limit"]
            assert (kept == -500) is saves, "which no host can know: it reads the same"
