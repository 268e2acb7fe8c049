"""Which machine file counts for a command, and what the names in it stand for: one place for every command.

The flag --machine comes before the environment, that before `motorbus.toml` in this folder, that before the file of the
user. It is looked for and read when a name asks for it: an address, which has a colon, needs no file.
"""

from __future__ import annotations

import os
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from motorbus.motion.machine import Machine

FLAG: Final = "--machine"
VARIABLE: Final = "MOTORBUS_MACHINE"
FILE: Final = "motorbus.toml"


class Place(NamedTuple):
    """A place where the file may be, and who said so; `told` when somebody named it, so that it must be there."""

    path: Path
    by: str
    told: bool


class MachineFile:
    """The machine file of one command. `told` is what was said, `by` what said it: --machine; "" when nothing did."""

    def __init__(self, told: str = "", by: str = FLAG) -> None:
        self.told = told
        self.by = by

    @property
    def places(self) -> list[Place]:
        """Where it is looked for, in order."""
        named = [(self.told, self.by), (os.environ.get(VARIABLE, ""), VARIABLE)]
        found = [Place(Path(path), by, True) for path, by in named if path]
        usual = [Place(Path(FILE), "found in this folder", False), Place(of_user(), "your own", False)]
        return [*found, *usual]

    @cached_property
    def path(self) -> Path | None:
        """The one that counts; None when nobody named one and none is in the usual places."""
        return next((place.path for place in self.places if place.told or place.path.is_file()), None)

    @cached_property
    def machine(self) -> Machine:
        """What it describes. Raises RequestError when there is none, or for what is wrong with it."""
        from motorbus.session.plan import loaded

        if self.path is None:
            raise RequestError(
                "there is no machine file",
                expected=f"{self.searched()}, or one named by {FLAG} or {VARIABLE}",
                advice="`motorbus init BUS` writes one; nothing was sent",
            )
        try:
            return loaded(self.path)
        except RequestError as error:
            self.told_of(error)
            raise

    def told_of(self, error: RequestError) -> None:
        """Add to an error about what is in the file which file that is, and how it came to be this one."""
        for place in self.places:
            if place.path == self.path:
                how = f"named by {place.by}" if place.told else place.by
                error.add_note(f"the machine file is {shown(place.path)}, {how}")
                return

    def searched(self) -> str:
        """Where a file would have been found, in words."""
        return " or ".join(shown(place.path) for place in self.places if not place.told)


_used: ContextVar[MachineFile | None] = ContextVar("machine_file", default=None)


@contextmanager
def using(told: str, by: str = FLAG) -> Iterator[MachineFile]:
    """Within it, the file that counts for a command that was given `--machine told`, "" for none."""
    file = MachineFile(told, by)
    token = _used.set(file)
    try:
        yield file
    finally:
        _used.reset(token)


def machine_file() -> MachineFile:
    """The machine file that counts here."""
    return _used.get() or MachineFile()


def machine() -> Machine:
    """The machine of its file. Raises RequestError when there is no file, or for what is wrong with it."""
    return machine_file().machine


def of_user() -> Path:
    """The machine file of this user, in the platform's folder for settings; whether it is there or not."""
    if os.name == "nt":
        home = Path(os.environ.get("APPDATA") or Path("~", "AppData", "Roaming"))
    else:
        home = Path(os.environ.get("XDG_CONFIG_HOME", ""))
    if not home.is_absolute():  # relative ones do not count
        home = Path("~", ".config") if os.name != "nt" else home
    try:
        return home.expanduser() / "motorbus" / FILE
    except RuntimeError:  # nobody's home
        return home / "motorbus" / FILE


def shown(path: Path) -> str:
    """A path as people write it: one in this folder begins with ./"""
    return str(path) if path.is_absolute() or path.parent != Path() else f"./{path}"


# -- names -------------------------------------------------------------------------------------------------------------


def is_address(text: str) -> bool:
    """Whether it is written as an address, which needs no file: there is a colon before ids and options."""
    return ":" in text.partition("#")[0].partition(",")[0]


def is_name(text: str) -> bool:
    """Whether it can be the name of an axis, a group or a bus, and nothing more: no address, no ids."""
    return not is_address(text) and "#" not in text


def addresses(text: str) -> list[str]:
    """The addresses that a word means: itself where it is one, else what it is the name of in the machine file.

    `arm` is a bus and `arm#3` a device on it; an axis is its device, a group those of its axes, by bus. Raises
    RequestError for a name that is in no file, and for what is wrong with the file.
    """
    if is_address(text):
        return [text]
    name, hash_, ids = text.partition("#")
    if "," in name:
        raise RequestError(
            f"{text!r}: a name has no options",
            expected=f"{name.partition(',')[0]}{hash_}{ids}, and each option as a flag: --baud 500k",
            advice="or write the whole address, FAMILY:PORT; nothing was sent",
        )
    known = _machine_for(text)
    if name in known.buses:
        return [f"{known.buses[name].address}{hash_}{ids}"]
    if hash_:
        raise _unknown(text, name, known, of_bus=True)
    if name not in known.axes and name not in known.groups:
        raise _unknown(text, name, known)
    found: dict[str, list[str]] = {}
    for axis in known.axes_of(name):
        spec = known.axes[axis]
        found.setdefault(known.buses[spec.bus].address, []).append(str(spec.node))
    return [f"{bus}#{'+'.join(nodes)}" for bus, nodes in found.items()]


def axes_called(words: Iterable[str]) -> dict[tuple[str, int], str]:
    """For devices that are named by axes, groups or buses: the name of the axis by address of the bus and id."""
    found: dict[tuple[str, int], str] = {}
    for word in words:
        known = machine() if is_name(word) else None
        for axis in known.axes_of(word) if known is not None else ():
            assert known is not None
            spec = known.axes[axis]
            found[known.buses[spec.bus].address, spec.node] = axis
    return found


def axes_at(address: str) -> dict[int, str]:
    """The axes of the machine file on the bus at this address, by id; none without a file, or where it has an error."""
    try:
        known = machine() if machine_file().path is not None else None
    except RequestError:
        return {}
    from motorbus.cli.line import same_line

    found = {}
    for name, spec in known.axes.items() if known is not None else ():
        with suppress(RequestError):  # an address that cannot be parsed is no bus at all
            if known is not None and same_line(known.buses[spec.bus].address, address):
                found[spec.node] = name
    return found


def name_of(address: str) -> str:
    """What a bus is called in the machine file; its address where there is none, or it is not in there."""
    try:
        buses = machine().buses if machine_file().path is not None else {}
    except RequestError:
        buses = {}
    return next((name for name, bus in buses.items() if bus.address == address), address)


def axes_named(words: Sequence[str], *, some: bool = True) -> list[str]:
    """The axes that names of axes, groups and buses stand for, each once; all of the machine for no names at all.

    Raises RequestError for a name that is in no file, for what is wrong with the file, and, where there must be `some`,
    for names or a machine without an axis.
    """
    found = dict.fromkeys([] if words else machine().axes)
    for word in words:
        known = _machine_for(word)
        if word not in known.axes and word not in known.groups and word not in known.buses:
            raise _unknown(word, word, known)
        found.update(dict.fromkeys(known.axes_of(word)))
    if some and not found:
        raise without_axes(words)
    return list(found)


def without_axes(words: Sequence[str] = ()) -> RequestError:
    """The error for a machine file without an axis, or with none for these names."""
    from motorbus.motion.machine.refusal import no_axes

    error = no_axes(words)
    error.summary = f"{machine().file}: {error.summary}"
    machine_file().told_of(error)
    return error


def _machine_for(text: str) -> Machine:
    """The machine, for a word that is no address. Raises RequestError where there is no file to find it in."""
    file = machine_file()
    if file.path is None:
        raise RequestError(
            f"{text!r} is not a bus address, and there is no machine file that could know it",
            expected="FAMILY:PORT, options after commas, ids after #; or a name of a machine file",
            cause=f"no file at {file.searched()}",
            advice="for example feetech:/dev/ttyACM0#3, or `motorbus init BUS` writes a file; nothing was sent",
        )
    return file.machine


def _unknown(text: str, name: str, known: Machine, *, of_bus: bool = False) -> RequestError:
    from motorbus.motion.machine.refusal import listed, nearest

    file = machine_file().path
    assert file is not None
    names = [*known.buses] if of_bus else [*known.buses, *known.axes, *known.groups]
    what = "bus" if of_bus else "bus, axis or group"
    if is_address(name):
        advice = "it is an address, and here go names only: the file has to know the axis"
    elif name in known.poses:
        advice = f"it is a pose: `motorbus pose {name}` goes there"
    elif of_bus and name in known.axes:
        advice = f"it is an axis: {name} alone means its device, {known.axes[name].device}"
    else:
        advice = nearest(name, names, "an address needs a colon: FAMILY:PORT")
    summary = f"{text!r}: {shown(file)} has no {what} {name!r}"
    error = RequestError(summary, expected=listed(names), advice=f"{advice}; nothing was sent")
    machine_file().told_of(error)
    return error


@contextmanager
def asked_of_the_file() -> Iterator[None]:
    """Around a look at what is in the machine file: an error for what is not says which file that is."""
    machine()  # what is wrong with the file as a whole says so itself
    try:
        yield
    except RequestError as error:
        machine_file().told_of(error)
        raise
