"""The same registers of several servos, written again and again with other values: SYNC WRITE for control loops.

What is plain goes through a `Mould`, which costs hardly more than the bytes of the packet; everything else is made as
`sync_write` makes it, which says in words what is wrong with a value.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import Any, Final, TypeAlias

from motorbus.core.register import RegisterMap, shown
from motorbus.core.request import Effect, Request
from motorbus.errors import RequestError
from motorbus.families.feetech.driver.group import block_of, distinct, sync_writes
from motorbus.families.feetech.driver.loop import check_ordered, known_row, one_packet
from motorbus.families.feetech.driver.mould import Mould, mould
from motorbus.families.feetech.driver.node import CHANGES, Node
from motorbus.families.feetech.driver.orders import Order, check_names, check_values, only_block, orders_of

Row: TypeAlias = "float | Sequence[float]"
"""The value of one servo where one register is written, else its values in the order of the names."""


class SyncWriter:
    """Makes the exchange that writes these registers of these servos; see `sync_writer`."""

    def __init__(self, servos: Sequence[Node], names: Sequence[str]) -> None:
        self.servos: Final = tuple(servos)
        self.names: Final = tuple(names)
        self._single: Final = len(self.names) == 1
        self._widths: Final = [len(self.names)] * len(self.servos)
        self._kinds: Final = tuple(
            [kind] * len(self.servos) for kind in (list, tuple)
        )  # the quickest look of all
        self._mould: Mould | None = None

    def __call__(self, values: Sequence[Row]) -> Request[None]:
        """The packet that writes these: one value for each servo, or where several registers are written one sequence
        of values, in the order of the names. In API units.

        Nobody acknowledges it; the gate judges its goals when it is about to leave. Raises RequestError when a servo is
        not prepared or does not heed this, when the values are not as many as there are servos, or one is no number;
        LimitExceeded when one fits no register.
        """
        made = self._mould
        if made is None or (made.seen is not CHANGES.now and not made.holds()):
            made = self._fit()
        request = None
        if made is not None and (type(values) is list or type(values) is tuple):
            flat = values if self._single else self._flat(values)
            request = None if flat is None else made.cast(flat)
        return request or self._slowly(values)

    def _flat(self, values: Any) -> list[Any] | None:
        """Rows of values, one behind the other; None where a row is too long or too short, or neither list nor tuple:
        of another kind may be as long as it likes, and the rows behind it would go to the wrong servos."""
        if [*map(type, values)] in self._kinds and [*map(len, values)] == self._widths:
            return [*chain.from_iterable(values)]
        return None

    def _fit(self) -> Mould | None:
        """Made anew when the settings of a servo have changed."""
        tables = [node.table for node in self.servos]
        if any(
            table is None or node.settings is None for table, node in zip(tables, self.servos, strict=True)
        ):
            return None
        rows = [
            [table[name] for name in self.names if name in table] for table in tables if table is not None
        ]
        if any(len(its) < len(self.names) for its in rows):
            return None
        self._mould = mould(self.servos, rows)
        return self._mould

    def _slowly(self, values: Sequence[Row]) -> Request[None]:
        check_ordered(values)
        if len(values) != len(self.servos):
            raise RequestError(
                f"{len(values)} values for {len(self.servos)} servos", advice="nothing was sent"
            )
        under = [
            node.settings for node in self.servos
        ]  # first of all: another thread may set others at any time
        for node in self.servos:
            known_row(node, "present_position")
        orders = [self._named(row) for row in values]
        for order in orders:
            check_values(order)
        blocks = [
            block_of(node, order)._replace(under=settings)
            for node, order, settings in zip(self.servos, orders, under, strict=True)
        ]
        return one_packet(list(sync_writes(self.servos, blocks)), len(self.servos))

    def _named(self, row: Row) -> dict[str, float]:
        its = (row,) if len(self.names) == 1 and not isinstance(row, Sequence) else row
        if not isinstance(its, Sequence) or len(its) != len(self.names):
            raise RequestError(
                f"{row!r} is no row of values", expected=", ".join(self.names), advice="nothing was sent"
            )
        return dict(zip(self.names, its, strict=True))


def sync_writer(servos: Sequence[Node], *names: str) -> SyncWriter:
    """What a control loop keeps to write the same adjoining RAM registers of all of these in every cycle.

    `write = sync_writer(servos, "goal_position")` once, then `bus.run(write(goals))`. With several names, as
    "goal_position", "goal_time", "goal_velocity", each servo gets a row of values. Raises RequestError for an unknown
    name, for none, for one that is there twice, for a servo that is named twice, and for registers that are not
    adjoining RAM or may not be written; whether they are says the map of a servo, so of those that are not prepared yet
    it is found out at the first call.
    """
    if not names:
        raise RequestError("no register is named", expected='as "goal_position"', advice="nothing was sent")
    for name in names:
        if not isinstance(name, str):
            raise RequestError(
                f"{shown(name)} is no name of a register",
                expected='as "goal_position"',
                advice="nothing was sent",
            )
    check_names(names)
    if len(set(names)) < len(names):
        raise RequestError(
            f"a register is named twice: {', '.join(names)}",
            expected="each name once, for it gets one value",
            advice="nothing was sent",
        )
    nodes = distinct(servos)
    for node in nodes:
        if node.table is not None and node.settings is not None and node.writable:
            _check_rows(node, node.table, names)
    return SyncWriter(nodes, names)


def _check_rows(node: Node, table: RegisterMap, names: Sequence[str]) -> None:
    """Raise RequestError where whatever is to be written could not be, with the words of the first call."""
    rows = [table[name] for name in names]
    for row in rows:
        if row.effect is Effect.IDENTITY or row.protected or not row.writable:
            orders_of(node, table, {row.name: 0})  # says why
    only_block(node, [Order(row, min(max(row.low, 0), row.high)) for row in rows], "SYNC WRITE")
