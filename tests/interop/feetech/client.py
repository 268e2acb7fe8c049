"""Any Python library, unmodified, driven by lines on standard input.

    python -S tests/interop/feetech/client.py MODULE

Nothing of this project is in the process; `peer.Peer` is the other end. Each line is a request in JSON, each answer
one line, `{"value": …}` or `{"error": …}` with what the library raised. The requests:

    ["new", HANDLE, NAME, ARGUMENTS]      call MODULE.NAME and keep its result under this handle
    ["call", OWNER, NAME, ARGUMENTS]      call a method of what is kept, of a class, or of MODULE ("")

An argument {"kept": HANDLE} is replaced by what is kept under it, {"pairs": [[KEY, VALUE], …]} by a dictionary.
OWNER may have attributes, as "sms_sts.groupSyncWrite". Bytes are returned as lists of numbers, a dictionary as a list
of pairs, and what JSON has no form for as its repr.
"""

from __future__ import annotations

import json
import sys
from importlib import import_module
from typing import Any


class Client:
    """The module and what was made of it."""

    def __init__(self, module: str) -> None:
        self.module = import_module(module)
        self.kept: dict[str, Any] = {}

    def new(self, handle: str, name: str, arguments: list[Any]) -> None:
        owner, _, last = name.rpartition(".")
        self.kept[handle] = self.call(owner, last, arguments)

    def call(self, owner: str, name: str, arguments: list[Any]) -> Any:
        first, *rest = owner.split(".")
        found = self.kept.get(first) or (getattr(self.module, first) if first else self.module)
        for part in rest:
            found = getattr(found, part)
        return getattr(found, name)(*map(self._resolved, arguments))

    def _resolved(self, argument: Any) -> Any:
        if not isinstance(argument, dict):
            return argument
        if "kept" in argument:
            return self.kept[argument["kept"]]
        return {key: self._resolved(one) for key, one in argument["pairs"]}


def plain(value: Any) -> Any:
    """The value in the forms of JSON."""
    if isinstance(value, (str, int, float, type(None))) and not hasattr(value, "name"):
        return value
    if isinstance(value, dict):
        return [[plain(key), plain(one)] for key, one in value.items()]
    if isinstance(value, list | tuple | bytes | bytearray):
        return [plain(one) for one in value]
    return repr(value)


def main() -> None:
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
