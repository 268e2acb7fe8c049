"""A program that gets SIGINT every millisecond, and says in JSON what came of it: `python -m tests.contract.bombarded`.

A program of its own, so that pytest gets none of the signals. The arguments are what it does, for how many seconds,
and the address or the machine file that it does it with.
"""

from __future__ import annotations

import itertools
import json
import os
import random
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from threading import Thread
from typing import Any

import motorbus
from motorbus import feetech

PERIOD = 0.001
"""s from one signal to the next."""
DEPTH = 4
"""Loops inside each other: a signal that arrives while an `except` clause is left ends one of them at most."""


class Bombardment:
    """Calls a function again and again while signals arrive; counts calls and what they raised."""

    def __init__(self, call: Callable[[], object], longest: float = PERIOD) -> None:
        self.calls = self.interrupts = 0
        self.errors: Counter[str] = Counter()
        self.strange: list[str] = []
        self._call = call
        self._longest = longest
        self._begun = self._over = False

    def run(self, seconds: float) -> dict[str, Any]:
        """Send the signals for so long, call until the last one has arrived."""
        sender = Thread(target=self._send, args=(seconds,))
        sender.start()
        self._endure(DEPTH)
        sender.join()
        return {
            "calls": self.calls,
            "interrupts": self.interrupts,
            "errors": dict(self.errors),
            "strange": self.strange,
        }

    def _send(self, seconds: float) -> None:
        while not self._begun:
            time.sleep(PERIOD)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(random.uniform(PERIOD, self._longest))
        time.sleep(100 * PERIOD)
        self._over = True

    def _endure(self, depth: int) -> None:
        while not self._over:
            try:
                if depth:
                    self._endure(depth - 1)
                else:
                    self._begun = True
                    self._call()
                    self.calls += 1
            except KeyboardInterrupt:
                self.interrupts += 1
            except motorbus.MotorbusError as error:
                self.errors[type(error).__name__] += 1
            except BaseException as error:
                self.strange.append(repr(error))


def after(read: Callable[[], Any]) -> tuple[Any, int]:
    """The first value that a read returns afterwards, and how many tries that took."""
    for tries in range(1, 11):
        try:
            return read(), tries
        except motorbus.MotorbusError:
            continue
    raise SystemExit("the bus cannot be used")


def read(address: str, seconds: float) -> dict[str, Any]:
    """Positions of servo 1."""
    with motorbus.open(address) as bus:
        servo = feetech.Servo(bus, 1)
        right = servo.position()
        found = Bombardment(servo.position).run(seconds)
        value, tries = after(servo.position)
        return {**found, "right": value == right, "tries": tries}


def boundary(address: str, seconds: float) -> dict[str, Any]:
    """The same; `unanswered` counts interrupted calls whose last request had no reply yet."""
    with motorbus.open(address) as bus:
        servo, unanswered = feetech.Servo(bus, 1), 0
        right = servo.position()
        records = bus.trace.subscribe(1_000)

        def call() -> None:
            nonlocal unanswered
            before = [record.direction for record in records]
            unanswered += before[-1:] == ["tx"]
            servo.position()

        found = Bombardment(call).run(seconds)
        value, tries = after(servo.position)
        return {**found, "right": value == right, "tries": tries, "unanswered": unanswered}


def machine(file: str, seconds: float) -> dict[str, Any]:
    """Positions and short moves of a robot with axes on two buses."""
    with motorbus.Robot.load(file) as robot:
        robot.enable_torque()
        numbers = itertools.count()

        def call() -> None:
            if next(numbers) % 50 == 0:
                robot.move(dict.fromkeys(robot.axes, 0.01 * (next(numbers) % 3)))
            else:
                robot.positions()

        found = Bombardment(call).run(seconds)
        robot.stop()
        values, tries = after(robot.positions)
        return {**found, "right": all(abs(value) < 0.1 for value in values.values()), "tries": tries}


def write(address: str, seconds: float) -> dict[str, Any]:
    """An EEPROM register by name: the lock is opened, written, read back and closed in about 20 ms."""
    with motorbus.open(address) as bus:
        servo, numbers = feetech.Servo(bus, 1), itertools.count()
        found = Bombardment(lambda: servo.write(max_temperature=50 + next(numbers) % 20), 0.03).run(seconds)
        value, tries = after(lambda: servo.read("max_temperature", "lock"))
        right = 50 <= value["max_temperature"] < 70 and value["lock"] == 1
        return {**found, "right": right, "tries": tries}


def rename(address: str, changes: float) -> dict[str, Any]:
    """The id becomes 2 and 1 again, with one signal in each change, up to 40 ms after the lock was opened."""
    with motorbus.open(address) as bus:
        node, interrupts, errors = 1, 0, []
        for _ in range(int(changes)):
            sender = Thread(target=_signal_when_unlocked, args=(bus.trace.subscribe(10_000),))
            sender.start()
            try:
                feetech.Servo(bus, node).set_id(3 - node)
                sender.join()
                time.sleep(PERIOD)
            except KeyboardInterrupt:
                interrupts += 1
            except motorbus.MotorbusError as error:
                errors.append(repr(error))
            found = [one for one in (1, 2) if _answers(feetech.Servo(bus, one))]
            if len(found) != 1 or feetech.Servo(bus, found[0]).read("lock") != {"lock": 1}:
                return {"right": False, "ids": found}
            node = found[0]
        return {"right": True, "interrupts": interrupts, "errors": errors}


def _signal_when_unlocked(records: Any) -> None:
    unlock = bytes((3, 55, 0))  # WRITE lock 0
    while not any(record.direction == "tx" and unlock in record.data for record in records):
        time.sleep(PERIOD)
    time.sleep(random.uniform(0, 0.04))
    os.kill(os.getpid(), signal.SIGINT)


def _answers(servo: feetech.Servo) -> bool:
    try:
        return bool(servo.ping())
    except motorbus.NoReply:
        return False


if __name__ == "__main__":
    job: Callable[[str, float], dict[str, Any]] = globals()[sys.argv[1]]
    print(json.dumps(job(sys.argv[3], float(sys.argv[2]))))
