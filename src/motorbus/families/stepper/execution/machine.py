"""How a controller gets from one moment to the next: a pure function of what it is, what is asked of it, and when.

Every function takes a `State` and a moment and gives the next `State` with what happened. First all that ends by
itself until then takes place, in order and at its own moments, so nothing depends on how often somebody looks. A moment
before the present phase began counts as its beginning.
"""

from __future__ import annotations

from dataclasses import replace

from motorbus.families.stepper.execution import order
from motorbus.families.stepper.execution.behaviour import USUAL, Behaviour
from motorbus.families.stepper.execution.state import After, Phase, State
from motorbus.families.stepper.execution.turn import Next, Turn
from motorbus.families.stepper.table import HOME_INPUT, Project, after_port


def due(state: State) -> float:
    """The next moment (s) at which something happens by itself; infinity when nothing does."""
    return state.until


def advance(state: State, to: float) -> Next:
    """Let time pass until this moment."""
    return Turn(state, to).result()


def start(state: State, project: Project, at: float, *, asked: bool = True) -> Next:
    """Start a project; `asked` by a command (else by input 3). What runs already is heeded as `busy` says."""
    turn = Turn(state, at)
    if turn.may_start():
        turn.start(project, asked)
    return turn.result()


def stop_project(state: State, at: float) -> Next:
    """Stop the project, by command or by input 4."""
    turn = Turn(state, at)
    turn.stop_project()
    return turn.result()


def stop_motor(state: State, at: float) -> Next:
    """Stop the motor, whatever makes it turn."""
    turn = Turn(state, at)
    turn.stop_motor()
    return turn.result()


def jog(state: State, project: Project, sign: int, at: float) -> Next:
    """Turn until stopped, forward (1) or in reverse (-1), with the speed of step 1 of this project."""
    turn = Turn(state, at)
    now = turn.state
    if now.phase is Phase.JOG and now.motion is not None:
        turn.accepted = now.motion.sign != sign and now.how.jog_reverse_while_jogging == "reverse"
        if turn.accepted:
            turn.halt(After.REVERSE)
    elif turn.may_start():
        turn.by_hand(Phase.JOG, project, None, sign)
    return turn.result()


def run_once(state: State, project: Project, at: float) -> Next:
    """Make the move of step 1 of this project once; neither its inputs nor its output nor its delay are heeded."""
    turn = Turn(state, at)
    if turn.may_start():
        step = project.step(1)
        count: int | None = order.pulses(project, step, turn.state.how)[0]
        if not step.distance and turn.state.how.zero_distance == "endless":
            count = None
        turn.by_hand(Phase.ONCE, project, count, step.sign)
    return turn.result()


def home(state: State, project: Project, at: float) -> Next:
    """Turn in reverse with the speed of step 1 of this project until input 5 is active.

    If it is already, homing is over at once: nothing turns, and what is counted stays as it is.
    """
    turn = Turn(state, at)
    if turn.may_start():
        if HOME_INPUT in turn.state.inputs:
            turn.homed_already()
        else:
            turn.by_hand(Phase.HOMING, project, None, -1)
    return turn.result()


def set_input(
    state: State, port: int, active: bool, at: float, *, in3_project: Project | None = None
) -> Next:
    """An input, 1 to 5, becomes active or inactive; `in3_project` is what input 3 starts."""
    turn = Turn(state, at)
    rises = active and port not in turn.state.inputs
    inputs = turn.state.inputs | {port} if active else turn.state.inputs - {port}
    turn.become(inputs=inputs)
    if rises:
        turn.input_rises(port, in3_project)
    return turn.result()


def set_output(state: State, port: int, level: int, at: float) -> Next:
    """Switch outputs (port 1 to 3, 4 for all) or both LEDs (5) by command, whatever runs."""
    turn = Turn(state, at)
    if port == 5:
        turn.become(leds=bool(level))
    turn.become(outputs=after_port(turn.state.outputs, port, level))
    return turn.result()


def set_stop_mode(state: State, mode: int) -> Next:
    """From now on a stop is slow (0) or immediate (1); one that is under way goes on as it began."""
    return Next(replace(state, stop_mode=mode))


def power_on(
    at: float,
    how: Behaviour = USUAL,
    *,
    inputs: frozenset[int] = frozenset(),
    home_with: Project | None = None,
    base: int = 0,
) -> Next:
    """The supply comes: at rest and all outputs off, or homing with the speed of step 1 of this project.

    `base` is where the motor stands, in pulses of the count before: without supply it does not turn, but whoever counts
    has lost count.
    """
    state = State(since=at, how=how, inputs=inputs, base=base)
    if home_with is None:
        return Next(state)
    return home(replace(state, stop_mode=home_with.stop_mode), home_with, at)


def power_off(state: State, at: float) -> Next:
    """The supply goes: motion, project and outputs with it."""
    turn = Turn(state, at)
    turn.rest(Phase.OFF)
    turn.become(run=None, outputs=0, leds=False, homed=False)
    return turn.result()
