"""Addresses of buses, their options, and `open`, `open_async`, `simulate`.

A bus is written FAMILY:PORT, options after commas, nodes after `#`:

    feetech:/dev/ttyACM0,baud=500000       feetech:socket://10.0.0.7:4000      feetech:COM7
    feetech:sim,ids=1-6,model=sts3215      feetech:sim:NAME                    feetech:/dev/ttyACM0#3

Opening writes nothing to a device: one read is sent, to learn whether the adapter echoes.
"""

from motorbus.session.address import Address, parse_address, parse_ids
from motorbus.session.echo import LOG
from motorbus.session.journals import journal_of, unfinished
from motorbus.session.opening import open, open_async, simulate
from motorbus.session.options import Opening, lock_name, prepare

__all__ = [
    "LOG",
    "Address",
    "Opening",
    "journal_of",
    "lock_name",
    "open",
    "open_async",
    "parse_address",
    "parse_ids",
    "prepare",
    "simulate",
    "unfinished",
]
