"""Any Python library, unmodified, told what to do by lines on standard input: name a thing, call a thing, list a thing.

    python -S tests/interop/feetech/client.py MODULE

Nothing of ours is in this process; `peer.Peer` is the other end. Each line is a request in JSON, each answer one line,
`{"value": …}` or `{"error": …}` with what the library raised. The requests:

    ["new", HANDLE, NAME, ARGUMENTS]      call MODULE.NAME and keep what it gives under this handle
    ["call", OWNER, NAME, ARGUMENTS]      call a method of what is kept, of a class, or of MODULE ("")
    ["look", OWNER, NAME]                 an attribute that is no method
    ["calls", OWNER]                      the names of its public functions and methods, those inherited left out
    ["names", OWNER]                      every public name

An argument {"kept": HANDLE} stands for what is kept under it, {"pairs": [[KEY, VALUE], …]} for a dictionary. OWNER may
go on with attributes, as "sms_sts.groupSyncWrite". Bytes come back as lists of numbers, a dictionary as a list of
pairs, and what JSON cannot say as {"shown": its repr}.
"""

from __future__ import annotations

import enum
import json
import sys
from importlib import import_module
from typing import Any

PLAIN = (str, int, float, bool, type(None))


class Client:
    """The module and what was made of it."""

    def __init__(self, module: str) -> None:
        self.module = import_module(module)
        self.kept: dict[str, Any] = {}

    def new(self, handle: str, name: str, arguments: list[Any]) -> None:
        owner, _, last = name.rpartition(".")
        self.kept[handle] = self.call(owner, last, arguments)

    def call(self, owner: str, name: str, arguments: list[Any]) -> Any:
        return getattr(self._owner(owner), name)(*map(self._meant, arguments))

    def look(self, owner: str, name: str) -> Any:
        return getattr(self._owner(owner), name)

    def calls(self, owner: str) -> list[str]:
        found = self._owner(owner)
        names = vars(found) if owner else dir(found)
        mine = [name for name in names if not name.startswith("_") and callable(getattr(found, name))]
        return sorted(mine)

    def names(self, owner: str) -> list[str]:
        return sorted(name for name in dir(self._owner(owner)) if not name.startswith("_"))

    def _owner(self, name: str) -> Any:
        first, *rest = name.split(".")
        found = (
            self.kept[first] if first in self.kept else getattr(self.module, first) if first else self.module
        )
        for part in rest:
            found = getattr(found, part)
        return found

    def _meant(self, argument: Any) -> Any:
        if not isinstance(argument, dict):
            return argument
        if "kept" in argument:
            return self.kept[argument["kept"]]
        return {key: self._meant(one) for key, one in argument["pairs"]}


def plain(value: Any) -> Any:
    """The same as JSON can say it."""
    if isinstance(value, enum.Enum):
        return {"shown": repr(value)}
    if isinstance(value, PLAIN):
        return value
    if isinstance(value, dict):
        return [[plain(key), plain(one)] for key, one in value.items()]
    if isinstance(value, list | tuple | bytes | bytearray):
        return [plain(one) for one in value]
    return {"shown": repr(value)}


def main() -> None:
    """Carry out one request a line until standard input ends."""
    client = Client(sys.argv[1])
    for line in sys.stdin:
        kind, *arguments = json.loads(line)
        try:
            answer = {"value": plain(getattr(client, kind)(*arguments))}
        except Exception as error:
            answer = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
