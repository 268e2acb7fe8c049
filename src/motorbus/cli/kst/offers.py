"""What common commands use of this family; `motorbus.cli.faces` says what each is for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from motorbus.cli import quantity
from motorbus.core import units
from motorbus.families import kst
from motorbus.families.kst import notifications, sdo
from motorbus.families.kst.profiles import PROFILES, current, temperature, version_text

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from motorbus.bus.blocking import Bus
    from motorbus.core.can_frame import CanFrame
    from motorbus.core.family import BusDriver
    from motorbus.core.register import Register

COMMANDS: Final = {
    "set_node_id()": "`motorbus kst node-id BUS#ID NEW`",
    "set_node_id(": "`motorbus kst node-id BUS#ID {}`",
    "set_bit_rate()": "`motorbus kst bit-rate BUS#ID RATE`",
    "provision()": "`motorbus kst provision`",
    "save()": "`motorbus kst save`",
    "set_mid_point()": "`motorbus kst mid-point`",
    "set_reversed()": "`motorbus kst reverse BUS#ID on|off`",
    "set_reversed(False)": "`motorbus kst reverse BUS#ID off`",
    "reversed()": "`motorbus kst reverse BUS#ID`",
    "isolated=True": "`motorbus scan BUS --bitrate all`",
}
CUT_OFF: Final = (
    "say what was cut off again, `motorbus set-id`, `motorbus set-baud` or `motorbus kst provision`: it asks the servo "
    "how far it has come, and goes on from there; nothing was sent"
)
VERSIONS: Final = ("firmware_version", "software_version")


def ping_everyone(bus: Bus) -> list[int]:
    """The servos that answer one read by everyone; on CAN their answers do not collide."""
    return sorted(bus.run(kst.broadcast_read("node_id", kst.settings_of(bus))))


def bit_rate_heard(
    bus: Bus, seconds: float, report: Callable[[object], None]
) -> tuple[int | None, dict[int, str]]:
    """The bit rate of this bus by listening alone, `seconds` at each rate, and what was heard at each.

    A rate that the adapter lacks is left out, and that is told. Raises RequestError when it can listen at none.
    """
    heard: dict[int, str] = {}

    def told(event: object) -> None:
        if isinstance(event, kst.Skipped):
            heard[event.rate] = f"not listened to: {event.why}"
        report(event)

    found = bus.run(kst.scan_bit_rates(kst.settings_of(bus), seconds=seconds), report=told)
    heard |= {rate: one.value for rate, one in found.activity.items()}
    return found.rate, {rate: heard[rate] for rate in bus.family.link.rates if rate in heard}


def budget_frames(driver: BusDriver, node: int) -> Mapping[str, tuple[Sequence[CanFrame], ...]]:
    """`write`: a goal and its acknowledgement; `read`: the position; for each frame all that it may be."""
    assert isinstance(driver, kst.KstDriver)
    settings = driver.settings
    table, limit = settings.profile.table, settings.profile.limit
    goal, present = table["goal_position"], table["present_position"]
    extended, sized = settings.extended, settings.sized
    to, at = (goal.address, goal.subindex or 0), (present.address, present.subindex or 0)
    values = [goal.encode(raw) for raw in range(-limit, limit + 1)]
    goals = [sdo.encode_download(node, *to, data, sized=sized, extended=extended) for data in values]
    told = [sdo.encode_upload_reply(node, *at, data, extended=extended) for data in values]
    return {
        "write": (goals, [sdo.encode_download_reply(node, *to, extended=extended)]),
        "read": ([sdo.encode_upload(node, *at, extended=extended)], told),
    }


def report_frames(driver: BusDriver, node: int) -> list[CanFrame]:
    """A report of every position."""
    assert isinstance(driver, kst.KstDriver)
    settings = driver.settings
    profile, extended = settings.profile, settings.extended
    form = profile.report_forms[0] if profile.report_forms else "sdo"
    return [
        notifications.encode_report(node, raw, form=form, extended=extended)
        for raw in range(-profile.limit, profile.limit + 1)
    ]


def meaning(row: Register, raw: int) -> str:
    """A version is text, a status current and temperature; everything else as its row says."""
    if row.name in VERSIONS:
        return version_text(raw.to_bytes(row.size, "little"))
    profile = next((one for one in PROFILES.values() if row is one.status_row), None)
    if profile is None:
        return quantity.meaning(row, raw)
    here = units.show(current(profile, raw), "current")
    return f"{here}, {units.show(temperature(raw), 'temperature')}"


def say(event: Any) -> str:
    """What an event of a scan or of provisioning says, in words; "" for one that says nothing to people."""
    if isinstance(event, kst.Suspicion):
        where = f"#{event.node} " if event.node else ""
        return f"{where}at {event.rate} bit/s: {event.what}"
    if isinstance(event, kst.PowerCycleNeeded):
        return "take the supply of this servo away now, and give it back"
    if isinstance(event, kst.Skipped):
        return f"nothing was sent at {event.rate} bit/s: {event.why}"
    return ""
