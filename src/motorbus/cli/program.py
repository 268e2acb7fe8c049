"""The entry point: registration of the commands, exit codes, signals, errors.

Commands are registered by name; the module of a command is imported when it is called.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, Final

from motorbus import __version__, errors
from motorbus.cli.common import Exit, NeedsConsent, Partial

if TYPE_CHECKING:
    from cyclopts import App


CODES: Final[Mapping[type[BaseException], Exit]] = {
    errors.PortNotFound: Exit.PORT_NOT_FOUND,
    errors.LinkLost: Exit.PORT_NOT_FOUND,
    errors.PortBusy: Exit.PORT_BUSY,
    errors.NoReply: Exit.NO_REPLY,
    errors.DeviceError: Exit.DEVICE_REFUSED,
    errors.RequestError: Exit.USAGE,
    errors.Refused: Exit.UNSAFE,
    errors.NotHomed: Exit.UNSAFE,
    errors.Interrupted: Exit.CANCELLED,
    errors.VerificationFailed: Exit.VERIFICATION_FAILED,
    errors.MotorbusError: Exit.FAILURE,
    NeedsConsent: Exit.UNSAFE,
    Partial: Exit.PARTIAL,
    KeyboardInterrupt: Exit.CANCELLED,
    BrokenPipeError: Exit.CANCELLED,
    OSError: Exit.FAILURE,
}

COMMANDS: Final[Mapping[str, Mapping[str, tuple[str, str]]]] = {
    "Find": {
        "scan": ("discover", "Find the devices on a bus; without a bus list the ports."),
        "info": ("discover", "Show model, firmware, limits, mode, and what blocks motion."),
        "init": ("discover", "Write a machine file from the devices that answer."),
    },
    "Set up": {
        "doctor": ("doctor", "Find out why it does not work; writes nothing."),
        "setup": ("motorbus.cli.setup:app", "Set up an arm step by step."),
    },
    "Watch": {
        "web": ("web", "Serve a page on which a machine is watched, moved and tuned."),
    },
    "Read and write": {
        "read": ("registers", "Read registers, or the state of a device."),
        "write": ("registers", "Write registers."),
        "monitor": ("registers", "Watch axes or devices."),
        "decode": ("decode", "Explain the bytes of frames."),
        "command": ("command", "List or run the commands of the manual of a device."),
    },
    "Move": {
        "move": ("motion", "Move axes together to positions."),
        "jog": ("motion", "Move an axis at a velocity."),
        "home": ("motion", "Move axes to their reference switches."),
        "pose": ("motion", "Move to a pose of the machine file; without a name list the poses."),
        "torque": ("motion", "Switch torque on or off."),
        "stop": ("motion", "Decelerate and hold."),
        "estop": ("estop", "Emergency stop of every open bus."),
        "teach": ("recording", "Record axes that are moved by hand."),
        "replay": ("recording", "Play a recorded trajectory."),
        "follow": ("recording", "Let axes track others."),
    },
    "Maintain": {
        "set-id": ("maintain", "Change the id of a device (EEPROM)."),
        "set-baud": ("maintain", "Change the rate of the devices on a bus (EEPROM)."),
        "set-zero": ("maintain", "Set the zero position of a device (EEPROM)."),
        "recover": ("maintain", "Finish an interrupted change."),
        "backup": ("maintain", "Save the settings of devices to a file."),
        "restore": ("maintain", "Write saved settings that differ, and verify them."),
    },
    "Simulate": {
        "simulate": ("simulate", "Serve simulated devices on a port."),
        "demo": ("demo", "Move nine simulated axes and draw them."),
    },
}
EPILOGUE: Final = """A bus is FAMILY:PORT, options after commas; a device is BUS#ID:

    feetech:/dev/ttyACM0           feetech:socket://10.0.0.7:4000
    feetech:/dev/ttyACM0#3         kst:can://slcan/dev/ttyACM0
    feetech:sim,ids=1-6            kst:can://socketcan/can0,bitrate=500000

With a machine file motorbus.toml, axes, groups and buses have names:

    motorbus init arm=feetech:/dev/ttyACM0
    motorbus move shoulder=30deg

Exit codes: 0 ok, 1 failure, 2 usage, 3 port not found, 4 port busy, 5 no reply,
6 partial, 7 device refused, 8 unsafe, 9 verification failed, 10 cancelled."""


def build() -> App:
    """The parser, with each command by its name only."""
    from cyclopts import App, Group, Parameter

    app = App(
        name="motorbus",
        help="Drive, simulate and diagnose motors on a bus.",
        version=f"motorbus {__version__}",
        help_format="plaintext",
        help_formatter="plain",
        help_epilogue=EPILOGUE,
        default_parameter=Parameter(negative="", show_default=lambda value: str(value) if value else None),
        suppress_keyboard_interrupt=False,
    )
    for order, (title, commands) in enumerate(COMMANDS.items()):
        group = Group(title, sort_key=order)
        for name, (module, line) in commands.items():
            function = name.replace("-", "_")
            place = module if ":" in module else f"motorbus.cli.{module}:{function}"
            app.command(place, name=name, help=line, group=group)
    group = Group("One family", sort_key=len(COMMANDS))
    for name, module in _families().items():
        app.command(f"{module}:app", name=name, help=f"Commands of {name} devices only.", group=group)
    group = Group("Program", sort_key=len(COMMANDS) + 1)
    app["--help"].group = app["--version"].group = group
    app.register_install_completion_command(help="Install tab completion for this shell.", group=group)
    return app


def _families() -> dict[str, str]:
    """The module of the commands of each built-in family that has some; imports no family."""
    folder = os.path.join(os.path.dirname(os.path.dirname(__file__)), "families")
    names = sorted(os.listdir(folder))
    return {
        name: f"motorbus.families.{name}.cli"
        for name in names
        if os.path.exists(os.path.join(folder, name, "cli.py"))
    }


def run(words: list[str], *, last: bool) -> int:
    """Run a command line; `last`: the process ends with it. Returns the exit code."""
    _open_closed_streams()
    with _signals(last=last):
        try:
            code = _dispatch(words)
            sys.stdout.flush()
        except SystemExit as end:  # rich ends the program when the reader of a help page is gone
            code = _report(BrokenPipeError(), words) if end.code == 1 else Exit.OK
        except (Exception, KeyboardInterrupt) as error:
            if exit_code(error) is None:
                raise
            code = _report(error, words)
    if last:
        for stream in (sys.stdout, sys.stderr):
            try:
                stream.flush()
            except (OSError, ValueError):
                _drop(stream)
    return code


def exit_code(error: BaseException) -> Exit | None:
    """The exit code of an error; None for a defect of the program."""
    if type(error).__module__.startswith("cyclopts."):
        return Exit.USAGE
    return next((CODES[kind] for kind in type(error).__mro__ if kind in CODES), None)


def _dispatch(words: list[str]) -> int:
    from motorbus.cli import output

    output.begin(json="--json" in words)
    app = build()
    words = [_protect(word) for word in _common_last(words)]
    if "--help" in words or "-h" in words:
        _show_examples(app, words)
    result = app(
        words,
        exit_on_error=False,
        print_error=False,
        result_action="return_value",
    )
    return result if isinstance(result, int) else Exit.OK


def _show_examples(app: App, words: list[str]) -> None:
    """The help of a command ends with the examples of its docstring."""
    import inspect

    chain, apps, _ = app.parse_commands([word for word in words if word not in ("--help", "-h")])
    command = apps[-1].default_command
    if chain and command is not None:
        apps[-1].help_epilogue = (inspect.getdoc(command) or "").partition("Examples:")[2].strip("\n")


def _common_last(words: list[str]) -> list[str]:
    """Options in front of the command moved to the end."""
    words = list(words)
    moved: list[str] = []
    while words and words[0].startswith("-") and words[0] not in ("--help", "-h", "--version"):
        has_value = words[0] in ("--machine", "--bus", "-o")
        moved += words[: 1 + has_value]
        del words[: 1 + has_value]
    return words + moved


def _protect(word: str) -> str:
    """`-30deg` is a quantity; with a blank in front the parser does not take it for an option."""
    return f" {word}" if (word[:1] == "-" and word[1:2].isdigit()) or word[:2] == "-." else word


def _report(error: BaseException, words: Sequence[str]) -> Exit:
    from motorbus.cli import output

    code = exit_code(error) or Exit.FAILURE
    if isinstance(error, BrokenPipeError):
        _drop(sys.stdout)
        return code
    if isinstance(error, OSError) and not isinstance(error, errors.MotorbusError):
        if error.filename is None:
            _drop(sys.stdout)
            error = errors.MotorbusError(f"the output cannot be written: {error.strerror}")
        else:
            code = Exit.USAGE
            error = errors.RequestError(f"{error.filename}: {error.strerror}")
    elif code is Exit.USAGE and not isinstance(error, errors.MotorbusError):
        error = _usage(error)
    output.print_error(error, code, as_json="--json" in words)
    return code


def _usage(error: Any) -> errors.RequestError:
    """An error of the parser in the words of this program."""
    from cyclopts import CoercionError

    chain = " ".join(["motorbus", *(error.command_chain or ())])
    text = str(error)
    if isinstance(error, CoercionError) and error.token is not None:
        token, argument = error.token, error.argument
        name = token.keyword or (argument.name if argument is not None else "")
        kind = {float: "a number", int: "a whole number"}.get(error.target_type or object, "possible")
        text = f"{name}: {token.value.strip()!r} is not {kind}"
        choices = argument.get_choices() if argument is not None else None
        return errors.RequestError(
            text,
            expected=f"one of {', '.join(choices)}" if choices else "",
            advice=f"`{chain} --help` shows the form",
        )
    return errors.RequestError(text, advice=f"`{chain} --help` shows the form")


# -- process -------------------------------------------------------------------------------------------------------


@contextmanager
def _signals(*, last: bool) -> Iterator[None]:
    """SIGTERM and SIGHUP interrupt as Ctrl-C does. After the `last` command signals are ignored."""
    import signal
    import threading

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    names = [name for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    taken = [number for name in names if signal.getsignal(number := getattr(signal, name)) is signal.SIG_DFL]
    for number in taken:
        signal.signal(number, signal.default_int_handler)
    try:
        yield
    finally:
        if last:
            taken.append(signal.SIGINT)
        for number in taken:
            signal.signal(number, signal.SIG_IGN if last else signal.SIG_DFL)


def _open_closed_streams() -> None:
    """Replace streams that the shell closed (`>&-`): the next port would get their number."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a console without "²"


def _drop(stream: Any) -> None:
    """Send the rest of a stream to nowhere: at its end the interpreter would fail with code 120."""
    with suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)
