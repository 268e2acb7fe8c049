"""The commands of an unmodified LeRobot drive simulated arms through the plugin.

`MOTORBUS_LEROBOT` is the folder of an environment with LeRobot and the plugin; `make lerobot` makes one for each
version and sets it. torch is a stand-in.
"""

from __future__ import annotations

import json
import os
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Self

import pytest

from motorbus.setup.presets import preset
from tests.support.processes import ROOT, Simulator, simulator

ENVIRONMENT = os.environ.get("MOTORBUS_LEROBOT", "")
JOINTS = [joint.name for joint in preset("so101").joints]
LIMIT = 240

pytestmark = pytest.mark.timeout(LIMIT + 60)


class Lerobot:
    """Two simulated arms, and a folder for the files of LeRobot."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.home = folder / "home"
        self.environment = {
            **os.environ,
            "HF_LEROBOT_HOME": str(self.home),
            "HF_HUB_OFFLINE": "1",
            "PYTHONUNBUFFERED": "1",
            "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent / "stand_in"), str(ROOT / "src")]),
        }

    def start(self, command: str, *arguments: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [str(Path(ENVIRONMENT, "bin", command)), *arguments],
            env=self.environment,
            cwd=self.folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def run(self, command: str, *arguments: str) -> tuple[int, str]:
        child = self.start(command, *arguments)
        output, _ = child.communicate(timeout=LIMIT)
        return child.returncode, output

    def calibration(self, kind: str, id: str) -> Path:
        return self.home / "calibration" / kind / f"{id}.json"

    def calibrate(self, kind: str, id: str, **changes: int) -> None:
        """Write a calibration file of servos as shipped."""
        values = {"drive_mode": 0, "homing_offset": 0, "range_min": 500, "range_max": 3500, **changes}
        path = self.calibration(kind, id)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({name: {"id": id, **values} for id, name in enumerate(JOINTS, 1)}))


FOLLOWER = "robots/motorbus_follower"
LEADER = "teleoperators/motorbus_leader"


class Conversation:
    """Answers the questions of a child as they come."""

    def __init__(self, child: subprocess.Popen[str]) -> None:
        self.child = child
        self.text = ""
        self._seen = 0
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.child.stdout is not None
        while letter := self.child.stdout.read(1):
            self.text += letter

    def wait(self, part: str) -> None:
        """Wait until this text has come since the last one."""
        wait_for(lambda: self.text.find(part, self._seen) >= 0 or self.child.poll() is not None)
        place = self.text.find(part, self._seen)
        assert place >= 0, self.text
        self._seen = place + len(part)

    def send(self, line: str) -> None:
        assert self.child.stdin is not None
        self.child.stdin.write(line + "\n")
        self.child.stdin.flush()

    def answer(self, question: str, line: str) -> None:
        self.wait(question)
        self.send(line)

    def end(self) -> int:
        return self.child.wait(LIMIT)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.child.kill()
        self._reader.join()
        with self.child:
            pass


def wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.fixture
def lerobot(tmp_path: Path) -> Lerobot:
    return Lerobot(tmp_path)


@pytest.fixture
def arms(tmp_path: Path) -> Iterator[tuple[Simulator, Simulator]]:
    with (
        simulator(tmp_path / "follower", "feetech", "--ids", "1-6", "--pace") as follower,
        simulator(tmp_path / "leader", "feetech", "--ids", "1-6", "--pace") as leader,
    ):
        yield follower, leader


def words(arms: tuple[Simulator, Simulator]) -> list[str]:
    follower, leader = arms
    return [
        *("--robot.type=motorbus_follower", f"--robot.port={follower.port}", "--robot.id=blue"),
        *("--teleop.type=motorbus_leader", f"--teleop.port={leader.port}", "--teleop.id=blue"),
    ]


def nodes(simulator: Simulator) -> list[Mapping[str, Any]]:
    found: list[Mapping[str, Any]] = json.loads(simulator.command("status"))["nodes"]
    return found


def counts(simulator: Simulator) -> list[int]:
    return [node["raw_position"] for node in nodes(simulator)]


def test_values_are_those_of_lerobot(lerobot: Lerobot) -> None:
    """Of 1,000 random joints; its own goals are cut to whole counts."""
    shown = subprocess.run(
        [str(Path(ENVIRONMENT, "bin", "python")), str(Path(__file__).with_name("arithmetic.py"))],
        env=lerobot.environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    worst = json.loads(shown.stdout)
    assert worst["value"] < 1e-9
    assert worst["count"] < 1


def test_teleoperate(lerobot: Lerobot, arms: tuple[Simulator, Simulator]) -> None:
    """The follower ends where the leader was put, limp, with 1 % corrupt replies on its line."""
    follower, leader = arms
    lerobot.calibrate(FOLLOWER, "blue")
    lerobot.calibrate(LEADER, "blue")
    follower.command("faults 1%: corrupt")
    child = lerobot.start("lerobot-teleoperate", *words(arms), "--fps=60", "--teleop_time_s=10")
    time.sleep(3)
    leader.command("push 1 20deg")
    leader.command("push 6 -15deg")
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 0, output
    assert counts(leader)[0] != 2048 or counts(leader)[5] != 2048
    for there, here in zip(counts(follower), counts(leader), strict=True):
        assert there == pytest.approx(here, abs=3), output
    assert not any(node["torque_enabled"] for node in nodes(follower))


def test_a_joint_that_is_unplugged_is_named(lerobot: Lerobot, arms: tuple[Simulator, Simulator]) -> None:
    follower, _ = arms
    lerobot.calibrate(FOLLOWER, "blue")
    lerobot.calibrate(LEADER, "blue")
    child = lerobot.start("lerobot-teleoperate", *words(arms), "--fps=60", "--teleop_time_s=120")
    wait_for(lambda: any(node["torque_enabled"] for node in nodes(follower)))
    follower.command("unplug 4")
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode != 0
    assert "NoReply" in output
    assert "wrist_flex" in output
    assert not any(node["torque_enabled"] for node in nodes(follower) if node["id"] != 4)


def test_the_arm_of_another_calibration_is_refused(
    lerobot: Lerobot, arms: tuple[Simulator, Simulator]
) -> None:
    """The ports are exchanged: the offsets of the follower are those of the file of the leader."""
    follower, _ = arms
    lerobot.calibrate(FOLLOWER, "blue", homing_offset=100)
    lerobot.calibrate(LEADER, "red")
    code, output = lerobot.run("lerobot-teleoperate", *words(arms), "--fps=60", "--teleop_time_s=5")
    assert code != 0
    assert "motorbus_leader/red" in output
    assert not any(node["torque_enabled"] for node in nodes(follower))


def test_calibrate(lerobot: Lerobot, arms: tuple[Simulator, Simulator]) -> None:
    follower, _ = arms
    robot = ["--robot.type=motorbus_follower", f"--robot.port={follower.port}", "--robot.id=new"]
    with Conversation(lerobot.start("lerobot-calibrate", *robot)) as talk:
        talk.answer("middle pose", "")
        talk.wait("end to end")
        for way in ("40deg", "-80deg", "40deg"):
            for node in range(1, 7):
                follower.command(f"push {node} {way}")
            time.sleep(2)
        talk.send("")
        assert talk.end() == 0, talk.text
    found = json.loads(lerobot.calibration(FOLLOWER, "new").read_text())
    assert list(found) == JOINTS
    for name, one in found.items():
        span = one["range_max"] - one["range_min"]
        assert span == (4095 if name == "wrist_roll" else pytest.approx(80 / 360 * 4096, abs=8))


def test_setup_motors(lerobot: Lerobot, tmp_path: Path) -> None:
    """Six servos as shipped, plugged in one at a time."""
    with simulator(tmp_path / "new", "feetech", "--ids", "11-16") as arm:
        for node in range(11, 17):
            arm.command(f"unplug {node}")
        robot = ["--robot.type=motorbus_follower", f"--robot.port={arm.port}", "--robot.id=new"]
        with Conversation(lerobot.start("lerobot-setup-motors", *robot)) as talk:
            for id in range(6, 0, -1):
                talk.wait(f"for id {id}")
                arm.command(f"plug {id + 10}")
                talk.send("")
                talk.wait(f"is id {id}")
                arm.command(f"unplug {id}")
            assert talk.end() == 0, talk.text
        assert sorted(node["id"] for node in nodes(arm)) == [1, 2, 3, 4, 5, 6]


def test_record(lerobot: Lerobot, arms: tuple[Simulator, Simulator]) -> None:
    """The recorded actions are the positions that the leader had."""
    _, leader = arms
    lerobot.calibrate(FOLLOWER, "blue")
    lerobot.calibrate(LEADER, "blue")
    leader.command("push 1 20deg")
    time.sleep(1)
    folder = lerobot.folder / "data"
    code, output = lerobot.run(
        "lerobot-record", *words(arms), "--dataset.repo_id=me/test", f"--dataset.root={folder}",
        "--dataset.single_task=test", "--dataset.num_episodes=1", "--dataset.episode_time_s=3",
        "--dataset.reset_time_s=0", "--dataset.fps=30", "--dataset.push_to_hub=false", "--dataset.video=false",
        "--play_sounds=false",
    )  # fmt: skip
    assert code == 0, output
    script = f"""
import json, pandas
actions = pandas.read_parquet({str(folder / "data")!r}).action
print(json.dumps([list(map(float, row)) for row in actions]))
"""
    shown = subprocess.run(
        [str(Path(ENVIRONMENT, "bin", "python")), "-c", script], capture_output=True, text=True, check=True
    )
    actions = json.loads(shown.stdout)
    assert 60 <= len(actions) <= 91
    here = (counts(leader)[0] - 2000) * 360 / 4095
    assert all(action[0] == pytest.approx(here, abs=0.1) for action in actions)
