"""What python-canopen, unmodified, makes of EDS files: it loads each that is named and prints what it understood.

Runs in a process of its own with nothing of ours in it. One JSON object on standard output: what runs here (version
and file of the library, whether motorbus is here too), and for each file the head and its objects by name.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from typing import Any

canopen: Any = import_module("canopen")  # so that types are checked alike whether it is installed or not


def variables(dictionary: Any) -> Iterator[Any]:
    """Every variable, also those inside an array or a record."""
    for item in dictionary.values():
        if isinstance(item, canopen.objectdictionary.ODVariable):
            yield item
        else:
            yield from (item[subindex] for subindex in item)


def described(path: str) -> dict[str, Any]:
    """The head of the file and its objects."""
    dictionary = canopen.import_od(path, node_id=0x25)
    device = dictionary.device_information
    return {
        "vendor": device.vendor_name,
        "product": device.product_name,
        "bit_rates": sorted(device.allowed_baudrates),
        "lss": device.LSS_supported,
        "comments": dictionary.comments.splitlines(),
        "kinds": {item.index: type(item).__name__ for item in dictionary.values()},
        "objects": {
            item.name: {
                "index": item.index,
                "subindex": item.subindex,
                "type": item.data_type,
                "access": item.access_type,
                "low": item.min,
                "high": item.max,
                "default": item.default,
                "factor": item.factor,
                "unit": item.unit,
                "mappable": item.pdo_mappable,
                "description": item.description,
            }
            for item in variables(dictionary)
        },
    }


def main() -> None:
    """Describe every file that is named on the command line."""
    answer = {
        "version": version("canopen"),
        "file": canopen.__file__,
        "motorbus": find_spec("motorbus") is not None,
        "files": {path: described(path) for path in sys.argv[1:]},
    }
    print(json.dumps(answer))


if __name__ == "__main__":
    main()
