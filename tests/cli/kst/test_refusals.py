"""Impossible and unsafe requests to CAN servos: one error, its exit code, and no write on the bus."""

from __future__ import annotations

import pytest

from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run

pytestmark = pytest.mark.usefixtures("state_folder")

READS = ("#40", "#60", "#70")
"""Specifiers of SDO requests that read."""


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ("set-id BUS#37 39", 8, "--yes"),
        ("set-id BUS#37 38 --yes", 2, "is taken"),
        ("set-id BUS#37 128 --yes", 2, "not the id of a servo"),
        ("set-id BUS#37 39 --timeout 0s --yes", 2, "timeout"),
        ("set-baud BUS#37 1000000 --yes", 2, "not alone"),
        ("kst reverse BUS#37 on --yes", 2, "profile"),
        ("kst mid-point BUS#37 --yes", 2, "profile"),
        ("kst reverse EXT#37 on", 8, "--yes"),
        ("kst mid-point EXT#37", 8, "--yes"),
        ("read BUS#37 status --profile kst-ext", 7, "does not exist"),
        ("move BUS#37+38=200deg --yes", 8, "out of range"),
        ("write BUS#37 present_position=1", 2, "present_position"),
        ("write BUS#37 node_id=38 --yes", 2, "motorbus set-id"),
        ("write BUS#37 goal_position=901raw --expert", 8, "out of range"),
        ("read BUS#37 --id-format wide", 2, "id_format=wide"),
        ("scan kst:can://slcan/dev/no-such-port", 3, "no-such-port"),
        ("scan kst:/dev/ttyACM0", 2, "can://"),
    ],
)
def test_refused_request_writes_nothing(
    words: str, code: int, message: str, servos: Simulation, newer: Simulation, run: Run
) -> None:
    before = dict(servos[37].memory), dict(newer[37].memory)
    ran = run(*words.replace("BUS", servos.url).replace("EXT", newer.url).split(), "-vv")
    assert (ran.code, ran.out) == (code, "")
    assert ran.err.count("error: ") == 1
    assert message in ran.err
    sent = [line for line in ran.err.splitlines() if " tx " in line]
    assert [line for line in sent if not any(read in line for read in READS)] == []
    assert (dict(servos[37].memory), dict(newer[37].memory)) == before


@pytest.mark.parametrize(
    ("words", "code", "shown", "refused"),
    [
        ("read BUS#37", 0, "position", "status"),
        ("read BUS#37 present_position status", 6, "present_position", "status"),
        ("monitor BUS#37 --count 1", 0, "0.0000", "status"),
        ("info BUS#37", 0, "firmware", "negative_limit"),
    ],
)
def test_f5_a_refused_object_costs_itself_only(
    words: str, code: int, shown: str, refused: str, servos: Simulation, run: Run
) -> None:
    ran = run(*words.replace("BUS", servos.url).split(), "--profile", "kst-ext")
    assert ran.code == code
    assert shown in ran.out
    assert f"refused {refused}" in " ".join((ran.out + ran.err).split())
    assert "no answer" not in ran.err
