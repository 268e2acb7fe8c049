"""Requests, replies and simulated nodes of a half-duplex serial bus (FEETECH) and of a CAN bus (KST), as bytes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from motorbus.core.can_frame import CanFrame
from tests.bus.adapter import Effect, Priority, request

BROADCAST = 254
ID, TORQUE, GOAL, POSITION = 5, 40, 42, 56  # registers of a servo
CAN_ID, CAN_POSITION, CAN_GOAL = 0x3000, 0x6002, 0x6003  # objects of a CAN servo


def checksummed(body: bytes) -> bytes:
    return b"\xff\xff" + body + bytes([~sum(body) & 0xFF])


def instruction(node: int, code: int, parameters: bytes = b"") -> bytes:
    return checksummed(bytes([node, len(parameters) + 2, code]) + parameters)


def status(node: int, data: bytes = b"", error: int = 0) -> bytes:
    """A reply of a servo."""
    return checksummed(bytes([node, len(data) + 2, error]) + data)


def said(node: int, value: int, count: int = 2) -> bytes:
    """The reply to `read`."""
    return status(node, value.to_bytes(count, "little"))


def read_frame(node: int, count: int = 2, address: int = POSITION) -> bytes:
    return instruction(node, 2, bytes([address, count]))


def write_frame(node: int, address: int, value: int) -> bytes:
    return instruction(node, 3, bytes([address, value]))


def group_frame(*nodes: int) -> bytes:
    return instruction(BROADCAST, 0x82, bytes([POSITION, 2, *nodes]))


def value_of(reply: bytes) -> int:
    return int.from_bytes(reply[5:7], "little")


def read(node: int, count: int = 2, **options: Any) -> Any:
    """Read the position in `count` bytes."""
    return request(
        read_frame(node, count),
        [(node, node, 6 + count)],
        lambda replies: value_of(replies[0]),
        **{"repeatable": True, **options},
    )


def write(node: int, value: int = 1, *, address: int = 20, **options: Any) -> Any:
    """Write one byte; it has no effect on motion or torque."""
    return request(write_frame(node, address, value), [(node, node, 6)], lambda _: "written", **options)


def move(node: int, value: int = 1, **options: Any) -> Any:
    """Order a goal."""
    options = {"effect": Effect.MOTION, "priority": Priority.CONTROL, "goal_of": node, **options}
    return write(node, value, address=GOAL, **options)


def torque(node: int, on: int = 1, **options: Any) -> Any:
    return write(node, on, address=TORQUE, **{"effect": Effect.TORQUE, **options})


def torque_off(node: int) -> Any:
    """A stop of one node."""
    return torque(node, 0, priority=Priority.STOP, repeatable=True)


def torque_off_everywhere() -> Any:
    frame = write_frame(BROADCAST, TORQUE, 0)
    return request(frame, [], lambda _: None, effect=Effect.TORQUE, priority=Priority.STOP, repeatable=True)


def group(*nodes: int, **options: Any) -> Any:
    """Read the positions of several nodes; a node that does not answer is missing from the result."""
    return request(
        group_frame(*nodes),
        [(node, node, 8) for node in nodes],
        lambda replies: {reply[2]: value_of(reply) for reply in replies},
        repeatable=True,
        **options,
    )


def upload_frame(node: int, index: int = CAN_POSITION) -> CanFrame:
    return CanFrame(0x600 + node, bytes([0x40, index & 0xFF, index >> 8, 0, 0, 0, 0, 0]))


def download_frame(node: int, value: int, tail: bytes = b"\0\0") -> CanFrame:
    head = bytes([0x22, CAN_GOAL & 0xFF, CAN_GOAL >> 8, 0])
    return CanFrame(0x600 + node, head + value.to_bytes(2, "little") + tail)


def uploaded(node: int, value: int, index: int = CAN_POSITION) -> CanFrame:
    """The reply to `can_read`."""
    head = bytes([0x4B, index & 0xFF, index >> 8, 0])
    return CanFrame(0x580 + node, head + value.to_bytes(2, "little") + b"\0\0")


def downloaded(node: int) -> CanFrame:
    """The reply to `can_move`."""
    return CanFrame(0x580 + node, bytes([0x60, CAN_GOAL & 0xFF, CAN_GOAL >> 8, 0, 0, 0, 0, 0]))


def can_value(replies: list[bytes]) -> int:
    return int.from_bytes(replies[0][4:6], "little")


def can_read(node: int, **options: Any) -> Any:
    options = {"repeatable": True, "lane": node, **options}
    return request(upload_frame(node), [(node, ("upload", CAN_POSITION), 8)], can_value, **options)


def can_move(node: int, value: int = 1, *, tail: bytes = b"\0\0", **options: Any) -> Any:
    options = {
        "effect": Effect.MOTION,
        "priority": Priority.CONTROL,
        "goal_of": node,
        "lane": node,
        **options,
    }
    frame, expected = download_frame(node, value, tail), [(node, ("download", CAN_GOAL), 8)]
    return request(frame, expected, lambda _: "written", **options)


class Servos:
    """Nodes of either bus that answer every request at once; `position(node)` gives what a read returns."""

    def __init__(self, position: Callable[[int], int] = lambda node: 100 * node) -> None:
        self.position = position
        self.silent: set[int] = set()

    def __call__(self, frame: bytes | CanFrame) -> list[Any]:
        answers = self._serial(frame) if isinstance(frame, bytes) else self._can(frame)
        return [data for node, data in answers if node not in self.silent]

    def _serial(self, frame: bytes) -> list[tuple[int, bytes]]:
        node, code, parameters = frame[2], frame[4], frame[5:-1]
        if code == 0x82:
            return [(one, said(one, self.position(one), parameters[1])) for one in parameters[2:]]
        if node == BROADCAST:
            return []
        if code != 2:
            return [(node, status(node))]
        if parameters[0] == ID:
            return [(node, status(node, bytes([node]) + bytes(parameters[1] - 1)))]
        return [(node, said(node, self.position(node), parameters[1]))]

    def _can(self, frame: CanFrame) -> list[tuple[int, CanFrame]]:
        node, index = frame.id - 0x600, frame.data[1] | frame.data[2] << 8
        if frame.data[0] != 0x40:
            return [(node, downloaded(node))]
        value = {CAN_ID: node, CAN_POSITION: self.position(node)}.get(index, 1)
        reply = uploaded(node, value, index)
        return [(node, reply._replace(data=reply.data[:3] + frame.data[3:4] + reply.data[4:]))]
