"""What a family declares comes out whole, in order, and each emergency stop by what it does."""

from __future__ import annotations

from motorbus.core.assurance import ABOUT, Assurance, Given, Point

ONE = Point(Given.YES, "so it is")


def declared(**changes: object) -> Assurance:
    names = [name for name in Assurance._fields if name not in ("estops", "led")]
    return Assurance(**{**dict.fromkeys(names, ONE), "estops": {"": ONE}, **changes})  # type: ignore[arg-type]


def test_every_point_is_shown_once_in_the_order_of_the_declaration() -> None:
    assert [about for about, _ in declared().points()] == list(ABOUT.values())
    assert tuple(ABOUT) == tuple(name for name in Assurance._fields if name != "led")


def test_each_emergency_stop_is_shown_by_what_it_does() -> None:
    hold = Point(Given.PARTLY, "it holds")
    shown = dict(declared(estops={"torque_off": ONE, "hold": hold}).points())
    assert shown["emergency stop: hold"] == hold
    assert shown["emergency stop: torque_off"] == ONE
