"""The machine behind the page: one robot, the lease of the page that moves it, one thread that runs its commands.

A stop runs in a thread of its own, needs no lease, and is repeated until the command that ran has ended.
"""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from math import isfinite
from pathlib import Path
from queue import Empty, SimpleQueue
from re import fullmatch
from threading import Event, Lock, Thread
from time import monotonic
from typing import Any, Final, Self, TypeAlias

import msgspec
from msgspec import Struct, structs

from motorbus.doctor.examine import examine_open
from motorbus.errors import Interrupted, MotorbusError, Refused, RequestError
from motorbus.motion import commands
from motorbus.motion.loop import ControlLoop
from motorbus.motion.moves import StopsIfInterrupted
from motorbus.motion.robot import Robot
from motorbus.setup.engine import Live, Note, Prompt, Step, run
from motorbus.setup.opened import PROCEDURES
from motorbus.web import messages
from motorbus.web.demo import SimulatedMachine
from motorbus.web.messages import Control, Done, Failed, Frame, Message, Notice

LOG: Final = logging.getLogger("motorbus.web")
LEASE: Final = 0.5  # s without a heartbeat after which the machine stops
GRACE: Final = 5.0  # s without any page after which the machine is shut down gracefully
FRAMES: Final = 50.0  # Hz
SILENT: Final = 1.0  # s without a position; such an axis is left out of the loop of the sliders
QUIET: Final = 1.0  # s at rest without a new target after which the loop of the sliders ends
STOP_TRIES: Final = 10
STOP_WAIT: Final = 0.2  # s until a stop is repeated
SHOW: Final = 0.1  # s between two live tables of a set-up
LOOK: Final = 0.2  # s between two looks at a stop while the user thinks
LONGEST_JOG: Final = 10.0  # s of a jog that the device times itself
FOLLOWING: Final = "follow"  # activity while sliders lead axes
Job: TypeAlias = Callable[[], Any]


class Page:
    """One connected page and what it has yet to be sent. Of states it gets the last one only. From any thread."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._events: deque[bytes] = deque(maxlen=100)
        self._frame: bytes | None = None
        self._changed = asyncio.Event()

    def put(self, message: Struct) -> None:
        """Send a message."""
        self._events.append(msgspec.json.encode(message, enc_hook=str))
        self._wake()

    def show(self, frame: bytes) -> None:
        """Send this state, unless a later one comes first."""
        self._frame = frame
        self._wake()

    def _wake(self) -> None:
        with suppress(RuntimeError):  # the server has ended
            self._loop.call_soon_threadsafe(self._changed.set)

    async def next(self) -> list[bytes]:
        """What is to be sent; waits until there is something."""
        await self._changed.wait()
        self._changed.clear()
        texts = [self._events.popleft() for _ in range(len(self._events))]
        if self._frame is not None:
            texts.append(self._frame)
            self._frame = None
        return texts


class PageFace:
    """A `Face`: steps go to `put`, answers of the user come by `answer`. A stop ends the procedure."""

    def __init__(self, put: Callable[[Struct], None], is_stopped: Callable[[], bool]) -> None:
        self.step: Prompt | Live | None = None
        self._answers: SimpleQueue[str] = SimpleQueue()
        self._put = put
        self._is_stopped = is_stopped
        self._shown = 0.0

    def answer(self, question: str, text: str) -> None:
        """The user answers the step with this text; dropped when another one is shown by now."""
        if self.step is not None and question == self.step.text:
            self._answers.put(text)

    def show(self, step: Step) -> str | None:
        """Show a step; waits for the answer of a prompt. Raises Interrupted after a stop."""
        if isinstance(step, Note):
            self._put(step)
            return None
        is_new = self.step is None or step.text != self.step.text
        if is_new:
            self._answers = SimpleQueue()
        self.step = step
        if is_new or isinstance(step, Prompt) or monotonic() - self._shown > SHOW:
            self._shown = monotonic()
            self._put(step)
        while True:
            if self._is_stopped():
                raise Interrupted("the set-up was stopped", advice="begin it again")
            try:
                return self._answers.get(timeout=LOOK if isinstance(step, Prompt) else 0.0)
            except Empty:
                if isinstance(step, Live):
                    return None


class Service:
    """Carries out the messages of pages, and sends them the states of the robot. Use it in a `with`.

    `folder` has the recordings. Its end stops what moves; the robot stays open. `changed` is set when a calibration has
    changed the machine file: open the machine again.
    """

    def __init__(self, robot: Robot, folder: Path, demo: SimulatedMachine | None = None) -> None:
        self.robot: Final = robot
        self.folder: Final = folder
        self.demo: Final = demo
        self.changed: Final = Event()
        self.activity = ""
        self.stops = 0
        self.pages: list[Page] = []
        self._holder: Page | None = None
        self._left_at = monotonic()
        self._targets: dict[str, float] = {}
        self._next: tuple[Page, str, Job] | None = None
        self._released = False  # the jog button, the recording, the set-up
        self._face = PageFace(lambda step: None, lambda: self._released)
        self._lock = Lock()  # of the fields above
        self._wake = Event()
        self._idle = Event()
        self._idle.set()
        self._closed = Event()
        self._stack = ExitStack()
        self._pool = ThreadPoolExecutor(4, "motorbus web")

    def __enter__(self) -> Self:
        self.lease = self._stack.enter_context(self.robot.attended(LEASE))
        self._states = self.robot.subscribe(rate=FRAMES, depth=1)
        self._threads = [
            Thread(target=self._work, name="motorbus web motion", daemon=True),
            Thread(target=self._send_states, name="motorbus web states", daemon=True),
        ]
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._closed.set()
        self._wake.set()
        if not self.changed.is_set():  # then nothing moves, and a stop would end that joints are limp
            self._stop(None, commands.Stop())
        for thread in self._threads:
            thread.join()
        self._pool.shutdown()
        self.robot.unsubscribe(self._states)
        with suppress(Refused):  # the lease is lost without a page
            self._stack.close()

    # -- pages -----------------------------------------------------------------------------------------------------

    def join(self, page: Page) -> None:
        """A page was opened; it may move the machine if no other one does."""
        self.pages.append(page)
        self._take(page, force=False)
        if self.activity and self._face.step is not None:
            page.put(self._face.step)

    def leave(self, page: Page) -> None:
        """A page was closed. If it moved the machine, its lease runs out."""
        self.pages.remove(page)
        self._left_at = monotonic()
        if page is self._holder:
            self._give(None)

    def broadcast(self, message: Struct) -> None:
        """Send a message to every page."""
        for page in tuple(self.pages):
            page.put(message)

    def _take(self, page: Page, *, force: bool) -> None:
        if self._holder is not None and page is not self._holder:
            if not force:
                page.put(Control("other"))
                return
            self._stop(None, commands.Stop())
        self.lease.reset()
        self._give(page)

    def _give(self, page: Page | None) -> None:
        self._holder = page
        for one in tuple(self.pages):
            one.put(Control("you" if one is page else "none" if page is None else "other"))

    # -- messages --------------------------------------------------------------------------------------------------

    def receive(self, page: Page, message: Message) -> None:
        """Begin what a message asks for; never waits. Raises MotorbusError for what is refused."""
        match message:
            case messages.Heartbeat():
                if page is self._holder and not self.lease.lost:
                    self.lease.beat()
            case commands.Stop() | commands.EStop():
                self._stop(page, message)
            case messages.Take(force):
                self._take(page, force=force)
            case commands.ReadRegisters():
                self._run(page, message)
            case _ if page is not self._holder or self.lease.lost:
                raise Refused("this page does not control the machine", advice="press Take control")
            case _:
                self._receive_motion(page, message)

    def _receive_motion(self, page: Page, message: Message) -> None:
        match message:
            case messages.Leave():
                self._stop(None, commands.Stop())
                self._give(None)
            case messages.Target(name, value, stops):
                self._check_stops(stops)
                if not isfinite(value) or not self.robot.axis(name).follows_setpoints:
                    raise RequestError(f"{name}: no target {value}", expected="a position that it can follow")
                self._set_target(name, value)
            case messages.JogStart(name, velocity, stops):
                self._check_stops(stops)
                self._start(page, f"jog {name}", lambda: self._jog(name, velocity))
            case messages.Release():
                self._released = True
                if (
                    self.activity.startswith("jog ")
                    and not self.robot.axis(self.activity[4:]).follows_setpoints
                ):
                    self._stop(None, commands.Stop((self.activity[4:],)))
            case messages.Inject(bus, order):
                if self.demo is None:
                    raise RequestError("faults can be injected in `motorbus web --demo` only")
                page.put(Done("inject", self.demo.inject(bus, order)))
            case messages.Examine():
                buses, config = self.robot.buses, self.robot.config
                self._start(page, "doctor", lambda: examine_open(config, buses, lambda: self._released))
            case messages.SetUp():
                face = PageFace(self.broadcast, lambda: self._released or self._is_left())
                self._start(page, message.kind, lambda: self._set_up(message, face))
                self._face = face
            case messages.Answer(question, text):
                self._face.answer(question, text)
            case commands.Torque(False) | commands.ClearFault() | commands.Reset():
                self._allow_writes()
                self._run(page, message)
            case commands.Teach():
                options = structs.asdict(message) | {"file": self._recording(message.file)}
                self._start(page, "teach", lambda: self._teach(**options))
            case commands.Replay():
                command = structs.replace(message, file=self._recording(message.file))
                self._start(page, "replay", lambda: self.robot.execute(command))
            case _:
                self._start(page, tag_of(message), lambda: self.robot.execute(message))  # type: ignore[arg-type]

    def _check_stops(self, stops: int) -> None:
        if stops != self.stops:
            raise Interrupted("the machine was stopped since", advice="release the control and take it again")

    def _recording(self, name: str) -> str:
        """The path of a recording. Raises RequestError for more than a plain name."""
        if not fullmatch(r"[\w-]{1,60}", name):
            raise RequestError(f"recording {name!r}", expected="a name of letters, digits, _ and -")
        self.folder.mkdir(exist_ok=True)
        return str(self.folder / f"{name}.csv")

    # -- stop ------------------------------------------------------------------------------------------------------

    def _stop(self, page: Page | None, command: commands.Stop | commands.EStop) -> None:
        """Stop in a thread of its own; commands and targets that wait are dropped."""
        with self._lock:
            self.stops += 1
            self._targets.clear()
            dropped, self._next = self._next, None
            self._released = True
        if dropped is not None:
            dropped[0].put(Failed(dropped[1], f"{dropped[1]} was stopped before it began"))
        Thread(target=self._carry_out_stop, args=(page, command), name="motorbus web stop").start()

    def _carry_out_stop(self, page: Page | None, command: commands.Stop | commands.EStop) -> None:
        if page is not None:
            self.broadcast(Notice("emergency stop" if isinstance(command, commands.EStop) else "stop"))
        for _ in range(STOP_TRIES):
            self._allow_writes()
            self._report(page, tag_of(command), lambda: self.robot.execute(command))
            if self._idle.wait(STOP_WAIT):
                return

    # -- commands --------------------------------------------------------------------------------------------------

    def _run(self, page: Page, command: Any) -> None:
        """Carry out a command beside what runs."""
        self._pool.submit(self._report, page, tag_of(command), lambda: self.robot.execute(command))

    def _start(self, page: Page, name: str, job: Job) -> None:
        """Carry out a command after the sliders. Raises Refused while another one runs."""
        with self._lock:
            self._check_free()
            self._next = page, name, job
            self._released = False
            self._idle.clear()
        self._wake.set()

    def _check_free(self) -> None:
        running = self._next[1] if self._next is not None else self.activity
        if running not in ("", FOLLOWING):
            raise Refused(f"{running} is running", advice="wait for its end, or stop it")

    def _set_target(self, name: str, value: float) -> None:
        with self._lock:
            self._check_free()
            self._targets[name] = value
            self._idle.clear()
        self._wake.set()

    def _report(self, page: Page | None, name: str, job: Job, end: Job = bool) -> None:
        """Run a job, then `end`; the page, without one every page, gets its result or error."""
        message: Done | Failed
        try:
            message = Done(name, job())
        except MotorbusError as error:
            message = failed(name, error)
        except Exception as error:
            LOG.exception("%s", name)
            message = Failed(name, f"{name}: {error}")
        end()
        (self.broadcast if page is None else page.put)(message)

    def _work(self) -> None:
        while not self._closed.is_set():
            self._wake.wait(0.1)
            self._wake.clear()
            with self._lock:
                job, self._next = self._next, None
                if job is not None:
                    self.activity = job[1]
                elif self._targets:
                    job, self.activity = (None, FOLLOWING, self._follow), FOLLOWING  # type: ignore[assignment]
                elif self._is_left() and any(axis.status.engaged for axis in self.robot.axes.values()):
                    job, self.activity = (None, "shutdown", self._park), "shutdown"  # type: ignore[assignment]
            if job is None:
                self._end()
            else:
                self._report(*job, self._end)

    def _end(self) -> None:
        with self._lock:
            self.activity = ""
            if self._next is None and not self._targets:
                self._idle.set()

    def _allow_writes(self) -> None:
        """End what the doctor has forbidden; it still only reads."""
        for bus in self.robot.buses.values():
            bus.read_only = False

    def _set_up(self, what: messages.SetUp, face: PageFace) -> None:
        try:
            if run(PROCEDURES[what.kind](self.robot, what.bus, what.names), face):
                self.broadcast(Notice("calibrated: the machine is opened again", reopens=True))
                self.changed.set()
        finally:
            face.step = None

    def _jog(self, name: str, velocity: float) -> Any:
        if self._released:
            return None
        if self.robot.axis(name).follows_setpoints:
            return self.robot.jog(name, velocity, until=lambda: self._released)
        axis = self.robot.axis(name)
        here, (low, high) = axis.status.known_position, axis.range
        seconds = LONGEST_JOG
        if here is not None and velocity:
            seconds = min(seconds, ((high if velocity > 0 else low) - here) / velocity)
        return self.robot.jog(name, velocity, seconds)

    def _teach(self, file: str, seconds: float, names: Any, rate: float, keep_torque: bool) -> Any:
        path = Path(file)
        if path.exists():
            raise RequestError(f"{path.stem} exists", advice="choose another name")
        made = self.robot.teach(
            names, seconds=seconds, until=lambda: self._released, rate=rate, keep_torque=keep_torque
        )
        path.write_text(made.text(self.robot.config.axes))
        return {"name": path.stem, "duration": made.duration, "notes": made.notes}

    # -- sliders ---------------------------------------------------------------------------------------------------

    def _follow(self) -> None:
        """Lead axes to the targets of the sliders until they rest, another axis is wanted, or a command waits."""
        now = self.robot.now()
        with self._lock:
            wanted = set(self._targets)
        for name, axis in self.robot.axes.items():
            if axis.follows_setpoints and now - axis.status.at < SILENT and not axis.status.fault:
                wanted.add(name)
        quiet_since = now

        def feed(loop: ControlLoop) -> bool:
            nonlocal quiet_since
            with self._lock:
                given = [name for name in self._targets if name in loop.axes]
                for name in given:
                    loop.set_target(name, self._targets.pop(name))
                if self._targets or self._next is not None or self._closed.is_set():
                    return False
            led = [axis for axis in loop.axes.values() if axis.owner is not None]
            rests = all(not one.sent if one.config.is_wheel else one.generator.arrived for one in led)
            if given or not rests:
                quiet_since = self.robot.now()
            return self.robot.now() - quiet_since < QUIET

        try:
            self.robot.carry_out(_lead(self.robot, sorted(wanted), feed))
        except BaseException:
            with self._lock:
                self._targets.clear()  # none of them is followed later
            raise

    # -- end of the pages ------------------------------------------------------------------------------------------

    def _is_left(self) -> bool:
        """No page has been open for a while."""
        return not self.pages and self.lease.lost and monotonic() - self._left_at > GRACE

    def _park(self) -> None:
        """Graceful stop; for its time the machine needs no lease."""
        self.robot.lease = None
        try:
            self.robot.shutdown()
        finally:
            self.robot.lease = self.lease

    def _send_states(self) -> None:
        while not self._closed.is_set():
            state = self._states.get(0.1)
            if self._holder is not None and self.lease.lost:
                self._give(None)
                self.broadcast(Notice("control lost: the page sent no heartbeat; the machine holds"))
            if state is None or not self.pages:
                continue
            latched = any(bus.latched for bus in self.robot.buses.values())
            frame = msgspec.json.encode(Frame(state, self.activity, latched, self.stops))
            for page in tuple(self.pages):
                page.show(frame)


async def _lead(robot: Robot, names: Sequence[str], feed: Callable[[ControlLoop], bool]) -> None:
    """Program: a loop of these axes while `feed`, which sets its targets, is true; then they brake."""
    loop = ControlLoop(robot, names, policy="clamp")
    async with StopsIfInterrupted(loop.members), loop:
        while feed(loop):
            await loop.cycle()
            await loop.wait()


def failed(name: str, error: MotorbusError) -> Failed:
    """An error as a message."""
    advice = "press Take control" if getattr(error, "reason", "") == "lease" else error.advice
    return Failed(
        name, error.summary, error.expected, error.cause, advice, tuple(getattr(error, "__notes__", ()))
    )


def tag_of(command: Any) -> str:
    """The name of a message."""
    return str(command.__struct_config__.tag)
