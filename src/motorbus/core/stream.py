"""Devices of a control loop, for families in which each device has its own requests."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Final, Generic, TypeVar

from motorbus.core.family import Positions
from motorbus.core.move import Device
from motorbus.core.register import shown
from motorbus.core.request import Precondition, Request, Stops
from motorbus.core.steps import Procedure, gather
from motorbus.errors import RequestError

N = TypeVar("N", bound=Device)


class PositionStream(Generic[N]):
    """Implements `core.family.PositionStream` with one read and one goal request for each device.

    `goal(device, position, precondition)` makes the request that sends a position (rad); it raises LimitExceeded for an
    impossible one. `start(device, speed)` prepares one device; `speed` in rad/s or None. `is_changed(device)`: settings
    were written since the stream was made, and goals may mean something else: they are refused.
    """

    def __init__(
        self,
        devices: Sequence[N],
        positions: Sequence[Request[Positions]],
        goal: Callable[[N, float, Precondition], Request[None]],
        start: Callable[[N, float | None], Procedure[None]],
        is_changed: Callable[[N], bool],
    ) -> None:
        self.nodes: Final = tuple(device.node for device in devices)
        self.positions: Final = tuple(positions)
        self._devices: Final = {device.node: device for device in devices}
        self._goal: Final = goal
        self._start: Final = start
        self._is_changed: Final = is_changed
        if len(self._devices) != len(devices) or not devices:
            raise RequestError(
                "an id is named twice" if devices else "no device is named", advice="name each device once"
            )

    def goals(self, to: Mapping[int, float]) -> Sequence[Request[None]]:
        """A request with a goal (rad) for each of these devices."""
        requests = []
        for node, position in to.items():
            device = self._device(node)
            precondition = partial(self._check_settings, device)
            if error := precondition():
                raise error
            requests.append(self._goal(device, position, precondition))
        return requests

    def _check_settings(self, device: N, _: Stops | None = None) -> RequestError | None:
        if not self._is_changed(device):
            return None
        return RequestError(
            f"the settings of node {device.node} were written since this stream was made",
            advice="end the loop and begin another",
            node=device.node,
        )

    async def start(self, speeds: Mapping[int, float]) -> None:
        """Prepare all devices at the same time; then raise the first error."""
        for node in speeds:
            self._device(node)  # raises
        await gather(*[self._start(device, speeds.get(node)) for node, device in self._devices.items()])

    def _device(self, node: int) -> N:
        if node not in self._devices:
            raise RequestError(
                f"node {shown(node)} is not in this stream",
                expected=f"one of {', '.join(map(str, self.nodes))}",
            )
        return self._devices[node]


def read_positions(node: int, position: Request[float]) -> Request[Positions]:
    """The request that reads the position of one device, with the value that a stream needs."""
    decode = position.decode
    assert decode is not None
    return position.with_decoder(lambda response: Positions({node: decode(response)}, (), response.at))
