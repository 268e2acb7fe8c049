"""What an emergency stop does to the axes of the machine file, for a bus that a command was given by its address.

Every process that holds a bus may be asked to stop it. So each opens it knowing whom it must not let fall.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from motorbus.cli.line import same_line
from motorbus.cli.machine import machine_file
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Mapping


def with_estops(address: str, options: Mapping[str, object]) -> dict[str, object]:
    """These options of a bus, and those by which its emergency stop does as `estop` of the machine file says.

    A file that cannot be understood says nothing; whoever needs it is told.
    """
    from motorbus.session import parse_address
    from motorbus.session.plan import estop_options

    file = machine_file()
    found = dict(options)
    if file.path is None:
        return found
    here = parse_address(address)
    try:
        machine = file.machine
        for name, spec in machine.buses.items():
            if same_line(spec.address, address):
                for option, held in estop_options(machine, name).items():
                    said = found.get(option, here.options.get(option))
                    found[option] = f"{said}+{held}" if said else held
    except RequestError:
        return dict(options)
    return found
