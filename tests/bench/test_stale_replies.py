"""Late replies and echo, the same for everybody: motorbus believes none of them, and what others believe is counted."""

from __future__ import annotations

import json
from collections.abc import Callable

import pytest

from bench import stale_replies
from bench.late import device
from bench.late.device import ID, Lateness, Servo, Tally, forged, place, tally
from bench.stale_replies import FAMILIES, LATE, OTHERS, Result
from tests.conftest import Figures

SEED = 7
PEERS_FULL = 100_000


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("family", FAMILIES)
def test_motorbus_believes_no_late_reply_and_no_echo(
    family: str, rounds: Callable[[int], int], figures: Figures
) -> None:
    full = 1_000_000
    count = full if rounds(full) == full else rounds(full) // 10
    late, *echo = stale_replies.of_ours(family, SEED, count, echoes=100)
    told(figures, late)
    assert late.tally.late > count / 200
    assert late.tally.stale == 0
    assert late.tally.right > 0.99 * count
    assert [one.tally.stale for one in echo] == [0] * len(echo)
    assert echo[0].tally.right == 100


@pytest.mark.soak
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("peer", OTHERS, ids=lambda peer: peer.name)
def test_what_others_believe_is_measured(peer: stale_replies.Peer, figures: Figures) -> None:
    found = stale_replies.of_peer(peer, SEED, PEERS_FULL)
    for one in found:
        told(figures, one)
    late, *echo = found
    assert late.tally.late > PEERS_FULL / 200
    assert late.tally.calls == late.tally.right + late.tally.stale + late.tally.errors == PEERS_FULL
    assert all(one.tally.calls == one.tally.right + one.tally.stale + one.tally.errors for one in echo)


def told(figures: Figures, one: Result) -> None:
    """Everybody's beside each other, under the promise that no late reply is believed."""
    what = "L7 late replies, as the next request is heard" if one.what == LATE else f"L8 {one.what}"
    promise = 3 if one.what == LATE else 0
    figures(f"{what}: {one.who}", family=one.family, promise=promise, seed=SEED, **one.figures())


@pytest.mark.parametrize("peer", [one for one in OTHERS if one.module == "sdk"], ids=lambda peer: peer.name)
def test_the_fault_is_one_that_others_fall_for(peer: stale_replies.Peer) -> None:
    """So the script can find what it looks for. In virtual time their figures are the same on every machine."""
    late, *echo = stale_replies.of_peer(peer, SEED, 2000)
    assert late.tally.stale > 1000
    assert [one.tally.stale for one in echo] == [device.ECHOES] * 3


def test_a_reply_that_is_late_comes_with_the_next_request_and_before_its_reply() -> None:
    servo = Servo(SEED, share=1.0)
    request = device.packet(ID, 2, bytes((56, 2)))
    assert servo.hear(request) == (b"", b"")
    first = device.packet(ID, 0, place(1).to_bytes(2, "little"))
    assert servo.hear(request) == (first, b"")
    assert servo.lateness.late == 2


def test_who_is_not_there_says_nothing_and_an_echo_comes_first() -> None:
    echoing = Servo(SEED, share=0.0, echo=True)
    nobody = device.packet(device.NOBODY, 1)
    assert echoing.hear(nobody) == (nobody, b"")
    assert echoing.heard == 0
    ping = device.packet(ID, 1)
    assert echoing.hear(ping) == (ping, device.packet(ID, 0))


def test_the_same_replies_are_late_for_the_same_seed() -> None:
    def late(seed: int) -> list[bool]:
        one = Lateness(seed)
        return [one.is_late(number) for number in range(2000)]

    assert late(1) == late(1) != late(2)
    assert 5 < sum(late(1)) < 50


def test_a_value_is_right_that_was_true_during_its_call() -> None:
    heard = [0]

    def ask(answer: int | None) -> Callable[[], int | None]:
        def asked() -> int | None:
            heard[0] += 1
            return None if answer is None else place(heard[0] - answer)

        return asked

    assert tally(ask(0), lambda: heard[0], 5) == Tally(5, 5, 0, 0)
    assert tally(ask(1), lambda: heard[0], 5) == Tally(5, 0, 5, 0)
    assert tally(ask(None), lambda: heard[0], 5) == Tally(5, 0, 0, 5)
    assert forged(lambda: True, 3) == Tally(3, 0, 3, 0)


def test_tables_and_records_say_the_same() -> None:
    found = [
        Result(LATE, "motorbus", "feetech", Tally(10, 9, 0, 1, 2)),
        Result("echo: read", "somebody", "kst", Tally(5, 0, 5, 0)),
    ]
    late, echo = stale_replies.tables(found)
    assert late.splitlines()[-1].split() == ["motorbus", "feetech", "read", "10", "2", "0", "1", "9"]
    assert echo.splitlines()[-1].split() == ["somebody", "kst", "read", "5", "5", "5", "0", "0"]
    records = json.loads(stale_replies.as_json(found, SEED))
    assert records[0]["wrong"] == 0
    assert records[1] == {
        "what": "echo: read", "who": "somebody", "family": "kst", "seed": SEED, "exchanges": 5, "faults": 5,
        "wrong": 5, "errors": 0, "right": 0,
    }  # fmt: skip


def test_who_is_not_installed_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(stale_replies, "missing", lambda: ["canopen"])
    monkeypatch.setattr("sys.argv", ["stale_replies"])
    assert stale_replies.main() == 1
    assert "NOT AVAILABLE: canopen" in capsys.readouterr().err


def test_it_fails_when_motorbus_believes_what_is_not_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for stale, code in ((0, 0), (1, 1)):
        found = [Result(LATE, "motorbus", "kst", Tally(10, 10 - stale, stale, 0, 1))]
        monkeypatch.setattr(stale_replies, "measured", lambda *given, found=found: found)
        monkeypatch.setattr("sys.argv", ["stale_replies"])
        assert stale_replies.main() == code
    assert "1 % of the replies late" in capsys.readouterr().out
