"""Machines over simulations of all three families, in virtual time: what the tests of the motion layer stand on.

    with machine(arm="1-6", can="0x25,0x26", lift=True) as (made, sims), Robot.of(made) as robot:
        robot["a1"].position()
        sims["arm"][3].unplug()

The axes of the bus `arm` are a1, a2 …, those of the bus `can` are c1, c2 …, and the one of the bus `stage` is `lift`,
in m. They form the groups `all`, `upper` (those of arm) and `led` (those of arm and can). Everything stands at 0, but
the lift, which is not homed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any

import motorbus
from motorbus.core.request import Data
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion.machine import Machine
from motorbus.session import parse_ids, prepare
from motorbus.simulation.named import Simulation

ARM = {"zero": "180 deg", "low": "-150 deg", "high": "150 deg", "unit": "deg"}
CAN = {"low": "-50 deg", "high": "50 deg", "unit": "deg"}
LIFT = {"travel": "5 mm", "low": "0 mm", "high": "200 mm", "unit": "mm"}
TURNING = {"max_velocity": "90 deg/s", "max_acceleration": "360 deg/s2"}
LINEAR = {"max_velocity": "20 mm/s", "max_acceleration": "100 mm/s2"}


class Heard(PerfectLine):
    """A line without faults that keeps what the host sent: `sims["arm"].line = Heard()`."""

    def __init__(self) -> None:
        self.sent: list[Data] = []

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            self.sent.append(data)
        return super().carry(sender, data, at)


class Cut(Heard):
    """A wire on which Ctrl-C is pressed while the host sends its frames of these numbers, from 1 on."""

    def __init__(self, *numbers: int) -> None:
        super().__init__()
        self.numbers = set(numbers)

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        found = super().carry(sender, data, at)
        if sender is Side.HOST and len(self.sent) in self.numbers:
            self.numbers.discard(len(self.sent))
            raise KeyboardInterrupt
        return found


def listened(sims: Mapping[str, Simulation]) -> None:
    """From now on `said` knows what is sent to these."""
    for sim in sims.values():
        sim.line = Heard()


def said(sims: Mapping[str, Simulation]) -> list[str]:
    """What was sent since `listened`, bus by bus, as `decode` calls each frame: `READ to servo 1 …`."""
    frames = ((sim, data) for sim in sims.values() if isinstance(sim.line, Heard) for data in sim.line.sent)
    flat = ((sim, data if isinstance(data, bytes) else data.flat()) for sim, data in frames)
    return [one.title for sim, data in flat for one in sim.family.open().decode(data)]


@contextmanager
def machine(
    arm: str = "",
    can: str = "",
    lift: bool = False,
    *,
    axes: Mapping[str, Mapping[str, Any]] | None = None,
    options: Mapping[str, Mapping[str, Any]] | None = None,
    extra: str = "",
    **every: Any,
) -> Iterator[tuple[Machine, dict[str, Simulation]]]:
    """A machine of these devices and its simulations by the names of the buses.

    `every` holds keys of every axis (`exit="torque_off"`), `axes` those of some by name; `options` are those of
    `motorbus.simulate` by the name of the bus, and `extra` is appended to the file (`[pose.ready]` …).
    """
    with ExitStack() as stack:
        kinds = {"arm": ("feetech", arm), "can": ("kst", can), "stage": ("stepper", "1" if lift else "")}
        sims = {
            bus: stack.enter_context(motorbus.simulate(family, ids=ids, **(options or {}).get(bus, {})))
            for bus, (family, ids) in kinds.items()
            if ids
        }
        text = described({bus: sim.url for bus, sim in sims.items()}, arm, can, lift, axes or {}, every)
        yield Machine.parse(text + extra, check_address=lambda address: prepare(address, {})), sims


def described(
    addresses: Mapping[str, str],
    arm: str,
    can: str,
    lift: bool,
    axes: Mapping[str, Mapping[str, Any]],
    every: Mapping[str, Any],
) -> str:
    """The file of such a machine, for buses at these addresses."""
    rows: dict[str, dict[str, Any]] = {}
    for number, node in enumerate(parse_ids(arm) if arm else (), 1):
        rows[f"a{number}"] = {"device": f"arm#{node}", **ARM, **TURNING}
    for number, node in enumerate(parse_ids(can) if can else (), 1):
        rows[f"c{number}"] = {"device": f"can#{node:#x}", **CAN, **TURNING}
    if lift:
        rows["lift"] = {"device": "stage#1", **LIFT, **LINEAR}
    text = "format = 1\n"
    for bus, address in addresses.items():
        text += f'[bus.{bus}]\naddress = "{address}"\n'
    for name, row in rows.items():
        text += f"[axis.{name}]\n{_lines({**row, **every, **axes.get(name, {})})}"
    return text + _groups(list(rows))


def _lines(keys: Mapping[str, Any]) -> str:
    """Keys in TOML; one that is None is left out."""
    return "".join(f"{key} = {_toml(value)}\n" for key, value in keys.items() if value is not None)


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else str(value)


def _groups(names: list[str]) -> str:
    groups = {
        "all": names,
        "upper": [name for name in names if name.startswith("a")],
        "led": [name for name in names if name != "lift"],
    }
    return "".join(f"[group.{group}]\naxes = {axes}\n" for group, axes in groups.items() if axes)
