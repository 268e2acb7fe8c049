"""What `motorbus stop --verify` adds: whether what was stopped is seen to rest, when everyone has been stopped."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, Final

from motorbus.cli.target import face, opened
from motorbus.core.steps import catch, gather
from motorbus.errors import MotorbusError, VerificationFailed
from motorbus.motion.safety.standstill import Rest, watched

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from motorbus.bus.blocking import Bus
    from motorbus.cli.output import Output

BY_HAND: Final = "stop it once more, or cut the power by hand"


def look(
    results: Sequence[dict[str, Any]], options: Mapping[str, str], output: Output
) -> list[MotorbusError]:
    """Look at each that has accepted a stop, and write into its result what was seen: `rest` and `evidence`.

    Gives an error for each that tells where it is and was not seen to rest. Of one that does not tell it nobody ever
    says that it rests, and that is no error.
    """
    errors: list[MotorbusError] = []
    for bus in dict.fromkeys(one["bus"] for one in results if one["done"]):
        there = [one for one in results if one["bus"] == bus and one["done"]]
        try:
            with opened(bus, options, output) as found:
                _judge(found, there, errors)
        except MotorbusError as error:
            for one in there:
                _unseen(one, error.summary)
            errors.append(error)
    return errors


def _judge(bus: Bus, there: Sequence[dict[str, Any]], errors: list[MotorbusError]) -> None:
    devices = {one["id"]: face(bus, one["id"]) for one in there}
    asked = {node: device for node, device in devices.items() if hasattr(type(device), "position")}
    told = dict(zip(asked, bus.run(_all_of(asked)), strict=True))
    for one in there:
        seen = told.get(one["id"])
        if seen is None or isinstance(seen, MotorbusError):
            _unseen(one, Rest.UNSEEN.value if seen is None else seen.summary)
        else:
            one |= {"rest": seen[0].name.lower(), "evidence": seen[0].value}
        if seen is not None and one["rest"] != "stopped":
            errors.append(_not_at_rest(one))


async def _all_of(devices: Mapping[int, Any]) -> list[Any]:
    asks = [partial(type(one).position.function, one) for one in devices.values()]
    return list(await gather(*[catch(watched(ask)) for ask in asks]))


def _unseen(one: dict[str, Any], why: str) -> None:
    one |= {"rest": "unseen", "evidence": why}


def _not_at_rest(one: Mapping[str, Any]) -> VerificationFailed:
    name = one.get("axis", f"{one['bus']}#{one['id']}")
    does = "still moves" if one["rest"] == "moving" else "was not seen to rest"
    return VerificationFailed(
        f"{name} has accepted the stop and {does}: {one['evidence']}",
        expected="three fresh readings at one place, over a tenth of a second",
        advice=BY_HAND,
        node=one["id"],
    )
