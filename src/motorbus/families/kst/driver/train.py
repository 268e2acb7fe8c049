"""Several servos of one bus, led in a loop: one prepared read each, and goals in frames of which all but the target
is known.

Every servo has a lane, so all frames of a cycle may be in flight at once. These servos go for each target at their own
speed, which nobody can bound. What a goal is judged by are the limits read before; where somebody has made this program
forget them (new limits, a new mid point, the other sense of rotation), goals mean something else and are refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, Final

from motorbus.core.family import Positions
from motorbus.core.register import is_number, shown
from motorbus.core.request import Precondition, Request, Stops
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import gather
from motorbus.errors import MotorbusError, RequestError
from motorbus.families.kst.driver.exchanges import answers, decided, download
from motorbus.families.kst.driver.feedback import position_exchange
from motorbus.families.kst.driver.motion import counts, limits, started, stop
from motorbus.families.kst.driver.node import Node


async def train(servos: Sequence[Node], *, rate: int) -> Train:
    """These servos, ready to be asked and told in a loop; id format and limits are read, and nothing is written.

    `rate` (bit/s) is that of the bus; it changes nothing here. Raises RequestError when one is named twice or there is
    none, else the first error of a servo that cannot be read, with a note for each other.
    """
    if len({node.node for node in servos}) != len(servos) or not servos:
        raise RequestError(
            "an id is named twice" if servos else "no servo is named",
            advice="name each servo once; nothing was sent",
        )
    found = await gather(*[_known(node) for node in servos])
    return Train(dict(zip(servos, found, strict=True)))


async def _known(node: Node) -> tuple[float, float]:
    """Its limits; one that was never heard and has none to tell is asked all the same, whether it is there."""
    await decided(node)
    known = await limits(node)
    if node.at == -inf:
        await answers(node)
    return known


class Train:
    """Servos in a loop; see `core.family.Train`. Made by `train`."""

    def __init__(self, servos: Mapping[Node, tuple[float, float]]) -> None:
        self.nodes: Final = tuple(node.node for node in servos)
        self.positions: Final = tuple(_position(node) for node in servos)
        self._leads: Final = {node.node: _Lead(node, known) for node, known in servos.items()}

    def goals(self, to: Mapping[int, float]) -> Sequence[Request[None]]:
        """A frame with a target (rad) for each of these.

        Raises LimitExceeded for what is no finite number or outside the profile, RequestError for a servo that is none
        of these, or whose limits may have been changed since.
        """
        return [self._lead(id).goal(value) for id, value in to.items()]

    async def begin(self, speeds: Mapping[int, float]) -> None:
        """Target := where it stands, of each, at the same time; with the start first where the profile has that rule.

        So it is known in which form each takes a target, before the first goal. No speed can be told; `speeds` are only
        looked at. Every servo is visited; the first error is raised then, with a note for each other.
        """
        for id, speed in speeds.items():
            _check_speed(self._lead(id).node, speed)
        await gather(*[_begin(lead.node) for lead in self._leads.values()])

    def _lead(self, id: int) -> _Lead:
        try:
            return self._leads[id]
        except KeyError:
            raise RequestError(
                f"node {shown(id)} is none of those that are led here",
                expected=f"one of {', '.join(map(str, self.nodes))}",
                advice="nothing was sent",
            ) from None


class _Lead:
    """One servo, and the limits (rad) that its goals are judged by."""

    def __init__(self, node: Node, known: tuple[float, float]) -> None:
        self.node: Final = node
        self._limits: Final = known
        self._row: Final = node.table["goal_position"]
        self._refusal: Final[Precondition] = self._changed

    def goal(self, to: float) -> Request[None]:
        """The frame with this target."""
        node, row = self.node, self._row
        if error := self._changed():
            raise error
        raw = counts(node, to)
        return download(
            node,
            row,
            row.encode(raw),
            states_length=node.dialect.states_length(node.node),
            goals=(Setpoint(node.node, "position", float(row.to_value(raw)), *self._limits),),
            refusal=self._refusal,
        )

    def _changed(self, _: Stops | None = None) -> MotorbusError | None:
        if self.node.limits is self._limits or self.node.limits == self._limits:
            return None
        return RequestError(
            f"the settings of node {self.node.node} were written since it was led, and goals may mean something else",
            expected="the limits, the mid point and the sense of rotation that it was asked for",
            advice="end the loop and begin another; nothing was sent",
            node=self.node.node,
        )


def _position(node: Node) -> Request[Positions]:
    """The position of one, as those of several are told."""
    one = position_exchange(node)
    read = one.decode
    assert read is not None
    return one.with_decoder(lambda answer: Positions({node.node: read(answer)}, (), answer.at))


async def _begin(node: Node) -> Any:
    if node.dialect.must_start:
        await started(node)
    await stop(node)


def _check_speed(node: Node, speed: float) -> None:
    if not (is_number(speed) and speed > 0):
        raise RequestError(
            f"node {node.node}: {shown(speed)} is no speed",
            expected="a finite number above 0, in rad/s",
            advice="leave it out; nothing was sent",
            node=node.node,
        )
