"""The shell's face: thin commands that parse, ask, call the floors below and print. No logic of their own.

One file per command, file name = command name, each loaded when it is called, so that `--help`, `--version` and
completion import no family, no serial port and no plotting. The commands of one family are in the module that
`Family.cli` names.
"""

from __future__ import annotations

import errno
import io
import logging
import os
import re
import signal
import sys
import threading
from contextlib import contextmanager, suppress
from inspect import signature
from typing import TYPE_CHECKING, Annotated, Any, Final, TextIO

from cyclopts import App, CycloptsError, Group, Parameter

from motorbus import __version__
from motorbus.cli import faces, flags, machine
from motorbus.cli.exits import Exit, exit_code
from motorbus.cli.output import Output
from motorbus.errors import MotorbusError, RequestError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from inspect import BoundArguments

# A command's parser lives as long as its module, so the groups it belongs to are made once, too.
_COMMANDS: Final[Mapping[Group, Mapping[str, str]]] = {
    Group("Find", sort_key=0): {
        "ports": "List the serial ports of this machine and what hangs on them.",
        "scan": "Find the devices on a bus.",
        "ping": "Ask devices whether they are there.",
        "info": "Say what a device is: model, firmware, limits, registers.",
        "init": "Write a machine file from what answers on the buses.",
    },
    Group("Look", sort_key=1): {
        "read": "Read registers, or the telemetry, of a device.",
        "monitor": "Watch devices: position, velocity, load, current, voltage, temperature, alarms.",
        "decode": "Explain the bytes of frames, and why a bad one is bad.",
        "loop-stats": "Measure how well a loop over axes keeps its rate; nothing moves.",
    },
    Group("Act", sort_key=2): {
        "write": "Write registers of a device.",
        "move": "Move devices to positions, several of them together.",
        "jog": "Turn a device at a speed for a time, and stop.",
        "home": "Let a device find its reference.",
        "pose": "Go to a pose of the machine, list its poses, or keep the present one.",
        "park": "Go where the machine file says that the axes are parked.",
        "hold": "Stay, with torque.",
        "teach": "Lead axes by hand, and write down where they went.",
        "replay": "Let axes carry out the movement in a file.",
        "follow": "Let axes go where others are led by hand.",
        "torque": "Switch the power stage on or off.",
        "calibrate": "Make the present pose of a device read another position, for good.",
        "stop": "Decelerate and hold.",
        "estop": "Emergency stop: stop a bus at once, from any shell.",
    },
    Group("Name", sort_key=3): {
        "set-id": "Give a device another id, for good.",
        "set-baud": "Let devices speak at another rate, for good.",
        "recover": "Finish or take back a change of id or rate that was cut off.",
    },
    Group("Without hardware", sort_key=4): {
        "simulate": "Serve simulated devices on a pseudo-terminal or a socket.",
        "demo": "Move nine simulated axes of three families together, and draw them.",
    },
}
UNWRITABLE: Final = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO, errno.EBADF)
"""Errors of a stream on which the output has no room, or that is not open for writing."""
ENDINGS: Final = ("SIGTERM", "SIGHUP")
"""Signals that end a program as Ctrl-C does."""
_FAMILIES: Final = Group("One family", sort_key=8)
_EVERYWHERE: Final = Group("Everywhere", sort_key=9)
_PROGRAM: Final = Group("Program", sort_key=10)


def build() -> App:
    """The parser with every command registered by name only; a command's file is imported when it is called."""
    app = App(
        name="motorbus",
        help="Drive, simulate and diagnose motors on a bus.",
        version=f"motorbus {__version__}",
        help_format="plaintext",
        help_epilogue=_EPILOGUE,
        default_parameter=Parameter(show_default=_default_shown),
        group_arguments=Group.create_default_parameters(),
        suppress_keyboard_interrupt=False,
    )
    for group, commands in _COMMANDS.items():
        for name, line in commands.items():
            file = name.replace("-", "_")
            app.command(f"motorbus.cli.{file}:app", name=name, help=line, group=group)
    for name in faces.names():
        line = f"What only {name} devices can do."
        app.command(f"motorbus.cli.faces:{name}", name=name, help=line, group=_FAMILIES)
    app["--help"].group = app["--version"].group = _PROGRAM
    app.register_install_completion_command(help="Install completion for this shell.", group=_PROGRAM)
    return app


def _default_shown(default: object) -> str | None:
    return str(default) if default else None


_COMMON: Final = re.compile(rf"--json|--verbose|-v+|{machine.FLAG}=.*")
_NEGATIVE: Final = re.compile(r"-[.]?[0-9].*")
"""A negative number, with a unit or without: no flag begins with a digit."""
_BARE: Final = (int, float, "int", "float", "float | None")

_EPILOGUE = """A bus is FAMILY:PORT with options after commas, a device is BUS#ID:

    feetech:/dev/ttyACM0               feetech:COM7,baud=500000
    feetech:socket://10.0.0.7:4000     feetech:sim,ids=1-6
    kst:can://slcan/dev/ttyACM0        kst:can://socketcan/can0,bitrate=500000

In a folder with a motorbus.toml, buses, axes and groups go by their names:

    motorbus init feetech:/dev/ttyACM0          motorbus move shoulder=30deg

`motorbus COMMAND --help` shows examples. Exit codes: 0 ok, 1 failure, 2 usage,
3 port not found, 4 port busy, 5 no reply, 6 partial, 7 device refused,
8 unsafe, 9 verification failed, 10 cancelled."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line (without the program's name) and return its exit code.

    Without arguments it is the program's own command line: then signals are ignored once the outcome is known, and
    what cannot be written is dropped, so that the interpreter ends with this exit code.
    """
    if arguments is not None:
        return _run(list(arguments), last=False)
    words = sys.argv[1:]
    sys.unraisablehook = _unraisable
    try:
        code = _run(words, last=True)
    except KeyboardInterrupt as second:  # a signal between the first one and the report of it
        _ignore_signals()
        code = _report(second, Exit.CANCELLED, Output(json="--json" in words))
    for stream in (sys.stdout, sys.stderr):
        _finish(stream)
    return code


def _run(words: list[str], *, last: bool) -> int:
    _fill_closed_streams()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a console that lacks "²" must not end the program
    output = Output(json="--json" in words)
    try:
        with _ended_like_ctrl_c(last=last):
            code = _launch(build(), words, output)
            sys.stdout.flush()
            return code
    except SystemExit as end:
        if end.code != 1:
            raise
        # rich ends the program so when the reader of a help page has gone
        return _report(BrokenPipeError(), Exit.CANCELLED, output)
    except (Exception, KeyboardInterrupt) as error:
        known = exit_code(error)
        if known is None:
            raise
        return _report(error, known, output)


def _unraisable(about: sys.UnraisableHookArgs) -> None:
    """A second Ctrl-C that strikes in a destructor, or a callback of a weak reference, is no news."""
    if about.exc_type is not KeyboardInterrupt:
        sys.__unraisablehook__(about)


def _ignore_signals() -> None:
    """A Ctrl-C that comes twice must not end the interpreter's clean-up with a traceback."""
    for name in ("SIGINT", *ENDINGS):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)


def _finish(stream: TextIO) -> None:
    """Write what is left, or drop it: the interpreter would end with code 120 and a traceback."""
    try:
        stream.flush()
    except (OSError, ValueError):
        _drop(stream)


def _drop(stream: TextIO) -> None:
    with suppress(OSError, ValueError):  # no descriptor, as in a test
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)


def _fill_closed_streams() -> None:
    """What the shell has closed (`>&-`) is None here, and its number would be given to the next port."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115


@contextmanager
def _ended_like_ctrl_c(*, last: bool) -> Iterator[None]:
    """Being told to end, or losing the terminal, cleans up as Ctrl-C does: an EEPROM lock must be closed again.

    Where this is the `last` thing that the process does, later signals are ignored.
    """
    names = [getattr(signal, name) for name in ENDINGS if hasattr(signal, name)]
    taken = [name for name in names if signal.getsignal(name) is signal.SIG_DFL]
    if threading.current_thread() is not threading.main_thread():
        taken = []  # Python lets only the main thread have handlers
    for name in taken:
        signal.signal(name, signal.default_int_handler)
    try:
        yield
    finally:
        if last:
            _ignore_signals()
        else:
            for name in taken:
                signal.signal(name, signal.SIG_DFL)


def _report(error: BaseException, code: Exit, output: Output) -> Exit:
    if isinstance(error, BrokenPipeError):
        _drop(sys.stdout)  # its reader has gone: there is nothing to say
        return code
    if isinstance(error, OSError) and error.errno in UNWRITABLE and error.filename is None:
        _drop(sys.stdout)
        error = MotorbusError(f"the output cannot be written: {error.strerror}")
    output.error(error)
    if isinstance(error, CycloptsError) and not output.json:
        chain = " ".join(["motorbus", *(error.command_chain or ())])
        output.note(f"  `{chain} --help` shows how to say it")
    return code


def _launch(app: App, words: Sequence[str], output: Output) -> int:
    @app.meta.default
    def launch(
        *words: Annotated[str, Parameter(show=False, allow_leading_hyphen=True)],
        as_json: Annotated[bool, Parameter(name="--json", negative="", group=_EVERYWHERE)] = False,
        verbose: Annotated[int, Parameter(name=["--verbose", "-v"], count=True, group=_EVERYWHERE)] = 0,
        file: Annotated[str, Parameter(name=machine.FLAG, group=_EVERYWHERE)] = "",
    ) -> int:
        """Run one command.

        Parameters
        ----------
        as_json
            One JSON document on stdout; JSON Lines for streams.
        verbose
            Say on stderr what happens; -vv says more.
        file
            Machine file, before $MOTORBUS_MACHINE and ./motorbus.toml.
        """
        output.json = as_json
        _refuse_rehearsal(app, words)
        command, bound, ignored = parse(app, words)
        bound.arguments.update(dict.fromkeys(ignored, output))
        with _logging(verbose), machine.using(file):
            try:
                result = command(*bound.args, **bound.kwargs)
            except RequestError as error:
                flags.explain(error, command, bound.arguments.get("options", {}))
                raise
        return result if isinstance(result, int) else Exit.OK

    app.meta.suppress_keyboard_interrupt = False
    code = app.meta(
        _common_first(words), exit_on_error=False, print_error=False, result_action="return_value"
    )
    return code if isinstance(code, int) else Exit.OK


def _refuse_rehearsal(app: App, words: Sequence[str]) -> None:
    """Raises RequestError for a dry run of a command that has none: it would be taken for an option of the bus."""
    chain, apps, rest = app.parse_commands(words)
    command = apps[-1].default_command
    if "--dry-run" not in rest or command is None or "dry_run" in signature(command).parameters:
        return
    why = (
        "a stop is never withheld" if chain == ("estop",) else "it changes no device, so nothing is withheld"
    )
    raise RequestError(
        f"`motorbus {' '.join(chain)}` has no --dry-run: {why}", advice="leave it out; nothing was sent"
    )


def _common_first(words: Sequence[str]) -> list[str]:
    """The flags that every command has may stand anywhere; the parser finds them for sure where they come first."""
    told = _machine_told(words)
    common = [word for word in told if _COMMON.fullmatch(word)]
    return [*common, *(word for word in told if not _COMMON.fullmatch(word))]


def _machine_told(words: Sequence[str]) -> list[str]:
    """`--machine FILE` as one word. Raises RequestError when no file follows."""
    told: list[str] = []
    for word in words:
        if told and told[-1] == machine.FLAG:
            told[-1] += f"={word}"
        else:
            told.append(word)
    if any(word in (machine.FLAG, f"{machine.FLAG}=") for word in told):
        raise RequestError(f"{machine.FLAG}: which file?", expected=f"{machine.FLAG} {machine.FILE}")
    return told


def parse(app: App, words: Sequence[str]) -> tuple[Any, BoundArguments, Mapping[str, Any]]:
    """The command that these words mean, its arguments, and those that it does not take from words.

    Raises CycloptsError for words that mean none, RequestError for words too many.
    """
    told = _told(words, _numbers(app, words))
    try:
        command, bound, ignored = app.parse_args(told, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        raise flags.surplus(error) or error from None
    bound.arguments.update({name: _as_said(value) for name, value in bound.arguments.items()})
    return command, bound, ignored


def _numbers(app: App, words: Sequence[str]) -> set[str]:
    """The options of the command meant that take a number without a unit."""
    command = app.parse_commands(words)[1][-1].default_command
    named = signature(command).parameters.values() if command is not None else ()
    return {f"--{one.name.replace('_', '-')}" for one in named if one.annotation in _BARE}


def _told(words: Sequence[str], numbers: set[str]) -> list[str]:
    """The words as the parser takes them; what follows an option that wants a number is that number."""
    told: list[str] = []
    for word in words:
        if told and told[-1] in numbers and _NEGATIVE.fullmatch(word):
            told[-1] += f"={word}"
        else:
            told.append(_positional(word))
    return told


def _positional(word: str) -> str:
    """-30deg is a quantity and no flag: for the parser its sign is written as a minus that begins none."""
    return flags.MINUS + word[1:] if _NEGATIVE.fullmatch(word) else word


def _as_said(value: object) -> object:
    """What the parser made of the words, with the sign that was said."""
    if isinstance(value, str):
        return "-" + value[1:] if value.startswith(flags.MINUS) else value
    if isinstance(value, tuple):
        return tuple(_as_said(one) for one in value)
    if isinstance(value, dict):
        return {name: _as_said(one) for name, one in value.items()}
    return value


@contextmanager
def _logging(verbose: int) -> Iterator[None]:
    """-v shows what the logger "motorbus" says on stderr, -vv every detail of it; silent otherwise."""
    logger = logging.getLogger("motorbus")
    if not verbose:
        yield
        return
    shown = logging.StreamHandler()
    shown.setFormatter(logging.Formatter("%(relativeCreated)7.0f ms  %(name)s  %(message)s"))
    before = logger.level
    logger.addHandler(shown)
    logger.setLevel(logging.INFO if verbose == 1 else logging.DEBUG)
    try:
        yield
    finally:
        logger.removeHandler(shown)
        logger.setLevel(before)
