"""The commands of the shell, each with words that work and words that are wrong."""

from __future__ import annotations

from typing import Final, NamedTuple


class Row(NamedTuple):
    """One command.

    In `good` and `bad`, `{bus}` is a FEETECH bus with the ids 1 to 3, `{stepper}` a stepper controller, and the files
    are those of `tests.cli.shell.write_files`. `bare` is the exit code without an argument. `consent`: it asks before
    it writes. `port`: it opens one.
    """

    name: str
    good: str
    bad: str
    bare: int = 2
    bad_code: int = 2
    consent: bool = False
    port: bool = True


ROWS: Final = (
    Row("doctor", "{bus}", "{bus} --loop often"),
    Row("scan", "{bus}", "{bus} --ids one", bare=0),
    Row("info", "{bus}#1", "feetech"),
    Row("init", "arm={bus} --to new.toml", "arm"),
    Row("read", "{bus}#1 present_position", "{bus}#1 no_such_register"),
    Row("write", "{bus}#1 max_temperature=65°C", "{bus}#1 max_temperature=hot", consent=True),
    Row("monitor", "{bus} --count 1", "{bus} --rate fast"),
    Row("decode", "--family feetech FF FF 01 02 01 FB", "--family no_such FF", port=False),
    Row("command", "{bus}#1 ping", "{bus}#1 no_such_command"),
    Row("move", "{bus}#1=181deg", "{bus}#1=far"),
    Row("jog", "{bus}#1 10deg/s --for 0.2s", "{bus}#1 10deg"),
    Row("home", "{stepper}#1", "{stepper}#1 --timeout soon", consent=True),
    Row("pose", "ready --machine machine.toml", "no_such --machine machine.toml", port=False),
    Row("torque", "on {bus}#1", "up {bus}#1"),
    Row("stop", "{bus}", "{bus}#x"),
    Row("estop", "{bus}", "feetech"),
    Row("teach", "new.csv {bus} --for 0.2s", "new.csv {bus} --rate never"),
    Row("replay", "wave.csv --machine machine.toml", "no_such.csv --machine machine.toml", port=False),
    Row("follow", "{bus}#1 {bus}#2 --for 0.2s", "{bus}#1 {bus}#2 --rate never", consent=True),
    Row("set-id", "{bus}#1 9", "{bus}#1 nine", consent=True),
    Row("set-baud", "{bus}#1 500k", "{bus}#1 12345", consent=True),
    Row("set-zero", "{bus}#1", "{bus}#1 --to up", consent=True),
    Row("recover", "{bus}", "feetech", bare=0),
    Row("backup", "{bus}#1 new.json", "{bus}#1 no_such_folder/new.json"),
    Row("restore", "saved.json {bus}#1", "no_such.json {bus}#1", consent=True),
    Row("simulate", "feetech --ids 1", "no_such_family", port=False),
    Row("demo", "--output new.png", "extra words", bare=0, port=False),
    Row("feetech mode", "{bus}#1", "{bus}#1 no_such_mode"),
    Row("feetech recover-overload", "{bus}#1", "{bus}#x"),
    Row("feetech reset", "{bus}#1", "{bus}#x", consent=True),
    Row("stepper check", "program.toml", "no_such.toml", port=False),
    Row("stepper write", "program.toml {stepper}", "no_such.toml {stepper}", consent=True),
    Row("stepper read", "{stepper}", "{stepper} --project 9"),
    Row("stepper run", "{stepper} 1", "{stepper} 9", consent=True),
    Row("stepper io", "{stepper}", "{stepper} 9=on"),
)
KST: Final = (
    Row("set-id", "{kst}#0x25 0x26", "", consent=True),
    Row("set-baud", "{kst}#0x25 1M", "", consent=True),
    Row("command", "{kst}#0x25 set_mid_point", "", consent=True),
    Row("command", "{kst}#0x25 move 30deg", "", consent=True),
    Row("write", "{kst}#0x25 goal_position=30deg", "", consent=True),
)
NAMES: Final = tuple(row.name for row in ROWS)
