"""The server of the page: who may ask, what bad messages do, who moves the machine, how it stops."""

from __future__ import annotations

import http.client
import json
import math
import random
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, get_args

import msgspec
import pytest
from websockets.exceptions import ConnectionClosed

from motorbus.cli import main
from motorbus.errors import MotorbusError
from motorbus.motion.commands import EStop, Stop
from motorbus.motion.machine import MachineConfig
from motorbus.web import service as services
from motorbus.web.messages import DECODER, Failed, Message, Take
from tests.web.demo import Client, Recorder, Served, serve, wait_for

READS: Final = (0x01, 0x02, 0x82)  # FEETECH: ping, read, sync read


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    with serve(tmp_path) as one:
        wait_for(lambda: one.robot.snapshot().axes["tilt"].age is not None)
        yield one


@pytest.fixture
def client(served: Served) -> Iterator[Client]:
    with Client(served) as one:
        one.wait(lambda page: page.got("control", holder="you") and bool(page.frame))
        yield one


# -- who may ask ---------------------------------------------------------------------------------------------------

FOUND: Final = ("/", "/describe", "/recordings", "/registers/base", "/static/app.js")
MISSING: Final = ("/registers/none", "/static/../app.py", "/none")
ROUTES: Final = dict.fromkeys(FOUND, 200) | dict.fromkeys(MISSING, 404) | {"/ws": 101}
UPGRADE: Final = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
}
REFUSED: Final = [
    ({"Cookie": ""}, 401),
    ({"Cookie": "motorbus=x; motorbus-{port}=wrong"}, 401),
    ({"Cookie": "motorbus-{port}=ä"}, 401),
    ({"Host": "evil.example:{port}"}, 403),
    ({"Host": "127.0.0.1"}, 403),
    ({"Host": "192.168.0.7:{port}"}, 403),
    ({"Origin": "http://evil.example"}, 403),
    ({"Origin": "null"}, 403),
    ({"Origin": "https://127.0.0.1:{port}"}, 403),
]


def ask(served: Served, path: str, headers: dict[str, str], method: str = "GET") -> tuple[int, Any, bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", served.server.port, timeout=5)
    connection.putrequest(method, path, skip_host=True)
    for name, value in headers.items():
        connection.putheader(name, value.encode())
    connection.endheaders()
    answer = connection.getresponse()
    found = answer.status, answer.headers, answer.read()
    connection.close()
    return found


def test_each_route_needs_cookie_host_and_origin(served: Served) -> None:
    line = served.sniff()
    for path, expected in ROUTES.items():
        extra = UPGRADE if path == "/ws" else {}
        assert ask(served, path, served.headers(**extra))[0] == expected, path
        alone = ask(served, path, served.headers(Origin="", **extra))[0]
        assert alone == (403 if extra else expected), path  # a socket needs an Origin
        for changes, status in REFUSED:
            given = {
                name: value.replace("{port}", str(served.server.port)) for name, value in changes.items()
            }
            found = ask(served, path, served.headers(**given, **extra))[0]
            assert found == (403 if extra else status), (path, changes)
    for method in ("POST", "PUT", "DELETE"):
        assert ask(served, "/describe", served.headers(), method)[0] == 405
    assert line.instructions <= set(READS)


def test_the_token_of_the_address_becomes_a_cookie(served: Served) -> None:
    host = served.headers()["Host"]
    path = "/?" + served.server.url.partition("?")[2]
    status, headers, _ = ask(served, path, {"Host": host})
    assert status == 303
    assert headers["Location"] == "/"
    assert {"HttpOnly", "SameSite=strict"} <= set(headers["Set-Cookie"].split("; "))
    assert ask(served, "/?token=wrong", {"Host": host})[0] == 401
    assert ask(served, path.replace("/?", "/describe?"), {"Host": host})[0] == 401
    _, headers, _ = ask(served, "/", served.headers())
    policy = headers["Content-Security-Policy"]
    assert "script-src 'self';" in policy
    assert "unsafe" not in policy


@pytest.mark.parametrize("words", [[], ["--token", "short"]])
def test_another_address_needs_a_token(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["web", "--demo", "--host", "0.0.0.0", *words]) == 2
    assert "--host needs --token" in capsys.readouterr().err


def test_missing_libraries_are_named(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motorbus.web.app.LIBRARIES", ("other.mjs",))
    assert b"other.mjs.\n`make assets` fetches them" in ask(served, "/", served.headers())[2]


# -- messages ------------------------------------------------------------------------------------------------------

MALFORMED: Final = [
    "",
    "{",
    '{"type":"none"}',
    '{"type":"move","goals":{"base":"far"}}',
    '{"type":"target","name":"base","value":NaN,"stops":0}',
    '{"type":"target","name":"base","value":1e999,"stops":0}',
    '{"type":"target","name":"no_axis","value":0,"stops":0}',
    '{"type":"device_command","name":"base","function":"reset"}',
    '{"type":"follow","pairs":{"base":"shoulder"},"seconds":1}',
    '{"type":"teach","file":"../../etc/x","seconds":1}',
    '{"type":"replay","file":"/etc/passwd"}',
    '{"type":"inject","bus":"none","order":"status"}',
    '{"type":"inject","bus":"arm","order":"unplug"}',
    '{"type":"setup","kind":"erase","bus":"arm"}',
    '{"type":"setup","kind":"number","bus":"gimbal"}',
    '{"type":"setup","kind":"calibrate","bus":"arm","names":["none"]}',
    '{"type":"answer"}',
    "[" * 20_000,
    "é\u0000",
]


def test_a_malformed_message_is_answered(client: Client) -> None:
    for text in MALFORMED:
        client.messages.clear()
        client.socket.send(text)
        client.wait(lambda page: page.got("failed"))
    client.messages.clear()
    client.socket.send(b"\xff\xfe")
    client.wait(lambda page: page.got("failed"))
    assert all(not one["torque"] for one in client.frame["state"]["axes"].values())


@pytest.mark.parametrize(("data", "code"), [("x" * 70_000, 1009), ("flood", 1008)])
def test_too_much_closes_the_connection(served: Served, data: str, code: int) -> None:
    with Client(served) as page:
        with suppress(ConnectionClosed):
            for _ in range(1 if len(data) > 10 else 2_000):
                page.socket.send(data)
        with pytest.raises(ConnectionClosed) as closed:
            page.wait(lambda _: False)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == code
    with Client(served) as page:  # the server lives
        page.wait(lambda one: bool(one.frame))


TAGS: Final = [kind.__struct_config__.tag for kind in get_args(Message) if kind not in (Stop, EStop, Take)]
FIELDS: Final = sorted({field for kind in get_args(Message) for field in kind.__struct_fields__} - {"force"})


def _random_message(chance: random.Random) -> bytes:
    words = ["base", "slide", "", "é", "../x", 0, -1, 1e300, 0.5, True, None, [], {}, ["base"], {"base": 1.0}]
    words += ["arm", "number", "calibrate"]
    message = {field: chance.choice(words) for field in chance.sample(FIELDS, chance.randrange(8))}
    text = json.dumps(message | {"type": chance.choice(TAGS)}).encode()
    if chance.random() < 0.2:
        text = bytes(chance.randrange(256) if chance.random() < 0.05 else byte for byte in text)
    return text


def test_random_messages_of_a_page_without_control_send_nothing(served: Served) -> None:
    chance = random.Random(43)
    line = served.sniff()
    page, holder = Recorder(), Recorder()
    served.service.join(holder)
    served.service.join(page)
    for _ in range(10_000):
        try:
            served.service.receive(page, DECODER.decode(_random_message(chance)))
        except (MotorbusError, msgspec.MsgspecError, UnicodeError):
            continue
    time.sleep(0.2)
    assert line.instructions <= set(READS)
    assert not any(isinstance(one, Failed) and "NoneType" in one.text for one in page.got)
    served.service.leave(page)


# -- who moves the machine -----------------------------------------------------------------------------------------


def slide(client: Client, value: float) -> None:
    """Move the slider of the base."""
    client.send(type="target", name="base", value=value, stops=client.frame["stops"])


def test_a_stop_ends_the_slider_until_it_is_taken_again(client: Client) -> None:
    slide(client, 2.0)
    client.wait(lambda page: page.axis("base")["position"] > 0.1)
    known = client.frame["stops"]
    client.send(type="stop")
    client.wait(lambda page: page.frame["stops"] > known and not page.frame["activity"])
    at = client.axis("base")["position"]
    client.send(type="target", name="base", value=2.0, stops=known)
    client.wait(lambda page: page.got("failed", text="the machine was stopped since"))
    time.sleep(0.3)
    client.wait(lambda page: page.axis("base")["age"] < 0.2)
    assert abs(client.axis("base")["position"] - at) < 0.05
    assert client.axis("base")["torque"]


@pytest.mark.parametrize("kind", ["stop", "estop"])
def test_a_page_without_control_stops_a_move(served: Served, client: Client, kind: str) -> None:
    with Client(served) as watcher:
        watcher.wait(lambda page: page.got("control", holder="other"))
        client.send(type="pose", name="reach", speed=0.3)
        client.wait(lambda page: page.axis("base")["position"] > 0.05)
        watcher.send(type="move", goals={"base": 0.0})
        watcher.wait(lambda page: page.got("failed"))
        watcher.send(type=kind)
        client.wait(lambda page: page.got("failed", of="pose"))
        client.wait(lambda page: page.frame["latched"] is (kind == "estop"))
    assert client.axis("base")["position"] < 1.0


def test_a_stop_reaches_the_machine_while_the_server_is_busy(served: Served) -> None:
    page = Recorder()
    served.service.join(page)
    served.service.receive(page, DECODER.decode(b'{"type":"pose","name":"reach","speed":0.3}'))
    wait_for(lambda: _beat(served) and served.position("base") > 0.05)
    for _ in range(8):  # every thread for commands is in use
        served.service._pool.submit(time.sleep, 1.0)
    begun = time.monotonic()
    served.service.receive(page, Stop())
    wait_for(lambda: _beat(served) and not served.service.activity)
    assert time.monotonic() - begun < 0.8
    assert served.position("base") < 1.0


def _beat(served: Served) -> bool:
    served.service.lease.reset()
    return True


def test_the_machine_holds_without_heartbeats_and_is_left_without_pages(
    served: Served, client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(services, "GRACE", 0.6)
    slide(client, 2.0)
    client.wait(lambda page: page.axis("base")["position"] > 0.1)
    client.silent.set()
    client.wait(lambda page: page.got("control", holder="none"))
    at = client.axis("base")["position"]
    client.wait(lambda page: not page.frame["activity"])
    assert at < 1.8
    slide(client, 2.0)
    client.wait(lambda page: page.got("failed", text="this page does not control the machine"))
    client.send(type="take")
    client.wait(lambda page: page.messages[-1] == {"type": "control", "holder": "you"})
    assert client.axis("base")["torque"]
    client.socket.close()
    wait_for(lambda: not served.robot.snapshot().axes["base"].torque)


def test_a_held_button_jogs_and_a_released_one_stops(served: Served, client: Client) -> None:
    for name, velocity in (("pan", 0.5), ("slide", 0.01)):
        before = served.position(name)
        client.send(type="jog_start", name=name, velocity=velocity, stops=client.frame["stops"])
        client.wait(lambda page, name=name: page.frame["activity"] == f"jog {name}")  # type: ignore[misc]
        time.sleep(0.2)
        client.send(type="release")
        client.wait(lambda page: not page.frame["activity"])
        after = served.robot.snapshot().axes[name].position
        assert after is None or before <= after < before + 0.4  # a stepper does not know how far it came


def test_a_recording_is_taught_and_replayed(served: Served, client: Client) -> None:
    client.send(type="teach", file="wave", seconds=20, names=["base"])
    client.wait(lambda page: page.frame["activity"] == "teach")
    time.sleep(0.5)
    client.send(type="release")
    client.wait(lambda page: page.got("done", of="teach"))
    assert json.loads(ask(served, "/recordings", served.headers())[2]) == ["wave"]
    client.send(type="replay", file="wave")
    client.wait(lambda page: page.got("done", of="replay"))


def test_the_doctor_only_reads_and_a_stop_ends_it(served: Served, client: Client) -> None:
    client.send(type="torque", on=True, names=["base"])
    client.wait(lambda page: page.got("done", of="torque"))
    served.faults.inject("arm", "supply 3 12")
    line = served.sniff()
    client.send(type="doctor")
    client.wait(lambda page: page.frame["activity"] == "doctor")
    slide(client, 1.0)
    client.wait(lambda page: page.got("failed", text="doctor is running"))
    client.wait(lambda page: page.got("done", of="doctor"), 30)
    assert line.instructions <= set(READS)
    report = client.last["result"]
    assert report["findings"][0].items() >= {"code": "supply-out-of-range", "where": "elbow"}.items()
    assert report["devices"].keys() == served.robot.axes.keys()
    client.wait(lambda page: not page.frame["activity"])
    client.send(type="doctor")
    client.wait(lambda page: page.frame["activity"] == "doctor")
    begun = time.monotonic()
    client.send(type="stop")
    client.wait(lambda page: page.got("failed", of="doctor", text="the doctor was stopped"))
    client.wait(lambda page: page.got("done", of="stop") and not page.frame["activity"])
    assert time.monotonic() - begun < 2.0
    assert not line.instructions <= set(READS)  # the stop was sent
    slide(client, 0.2)
    client.wait(lambda page: abs(page.axis("base")["position"] - 0.2) < 0.02)


def test_a_joint_is_calibrated(served: Served, client: Client) -> None:
    before = served.robot.config.axes["base"]
    with Client(served) as watcher:
        client.send(type="setup", kind="calibrate", bus="arm", names=["base"])
        client.wait(lambda page: page.last["type"] == "prompt")
        prompt = client.last
        watcher.wait(lambda page: page.got("prompt"))
        watcher.send(type="answer", question=prompt["text"], text="go")
        watcher.wait(lambda page: page.got("failed", text="this page does not control the machine"))
        assert not client.got("live")
        client.send(type="answer", question="another question", text="go")
        client.send(type="answer", question=prompt["text"], text="go")
        for degrees, column, end in ((80, 2, "260"), (-160, 0, "100")):
            client.wait(lambda page: page.last["type"] == "live")
            served.faults.inject("arm", f"push 1 {degrees}deg")
            client.wait(lambda page, at=column, end=end: page.last["rows"][0]["values"][at] == end)  # type: ignore[misc]
        client.send(type="answer", question=client.last["text"])
        client.wait(lambda page: page.got("notice", reopens=True))
    assert served.service.changed.is_set()
    made = MachineConfig.load(served.robot.config.path).axes["base"]
    assert (made.zero, made.low, made.high) != (before.zero, before.low, before.high)
    assert made.high == pytest.approx(math.radians(78), abs=0.01)
    client.send(type="clear_fault", names=["base"])
    client.send(type="move", goals={"base": 0.1})  # it would move by the zero of the old file
    client.wait(lambda page: page.got("failed", of="move") and page.got("failed", of="clear_fault"))


def test_a_slow_page_delays_no_other(served: Served, client: Client) -> None:
    with Client(served):  # reads nothing
        slide(client, 1.0)
        numbers = []
        end = time.monotonic() + 1.5
        while time.monotonic() < end:
            client.wait(lambda page: page.frame["state"]["number"] not in numbers)
            numbers.append(client.frame["state"]["number"])
            slide(client, 1.0 + 0.1 * (len(numbers) % 2))
    assert len(numbers) > 30
