"""Show a machine by hand what to do: its axes are let go and guided, and where they are is written down on a grid."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable

from motorbus.core.family import Quality
from motorbus.errors import MotionError, MotorbusError, RequestError
from motorbus.motion import group
from motorbus.motion.body import Body
from motorbus.motion.follow import Ending, check_able, check_seconds
from motorbus.motion.loop.cycle import divided
from motorbus.motion.loop.faces import Errand, LoopFace
from motorbus.motion.loop.readings import LoopState
from motorbus.motion.profile.shapes import NOTHING
from motorbus.motion.trajectory import Trajectory
from motorbus.motion.trajectory.samples import MOST

LOG = logging.getLogger("motorbus.motion")


def teach(
    body: Body,
    names: str | Iterable[str] | None = None,
    *,
    seconds: float | None = None,
    rate: float = 50.0,
    until: Callable[[], bool] | None = None,
    limp: bool = True,
) -> Errand[Trajectory]:
    """Let these axes go and write down where they are guided, `rate` times a second (Hz); None: all that can be taught.

    The trajectory has the times of the readings, from 0 on: those of a loop that was held up are late, and stand where
    they were taken. A cycle in which an axis was not heard, or cannot be believed, has no sample; nothing is
    smoothed, see `Trajectory.smoothed`. With `limp=False` torque is left as it is, for axes that something else
    moves.

    It ends after `seconds`, or when `until`, which is asked in each cycle, gives True. Without either, Ctrl-C ends it
    and what was taught is given. With as many samples as a trajectory can have (`MOST`) it ends too, and the log says
    so. The axes stay limp. Raises RequestError for an axis that cannot be taught by hand, or
    whose device cannot be asked in a loop; MotionError for less than two samples; and what a `Loop` raises, as when an
    axis falls silent or a port is gone: the trajectory until then is `so_far` of that error.
    """
    check_seconds(seconds)
    axes = taught(body, names, limp=limp)
    teaching = _Teaching(rate, seconds, until)
    return Errand(
        teaching,
        rate,
        axes,
        before=(lambda: group.disable_torque(body, axes)) if limp else None,
        endless=seconds is None and until is None,
        failed=teaching.failed,
    )


def taught(body: Body, names: str | Iterable[str] | None, *, limp: bool) -> tuple[str, ...]:
    """The axes that are taught of these; of all (None) those who can be. Raises RequestError for one that cannot be
    taught, or when none can be. Nothing is sent."""
    chosen = body.chosen(names)
    if names is not None:
        check_able(body, chosen, "stream", "taught: nothing tells where it is in a loop")
        if limp:
            check_able(body, chosen, "disable_torque", "taught by hand")
        return tuple(chosen)
    led, without = divided(chosen)
    if not led:
        raise RequestError(
            "none of these axes can be taught",
            expected="an axis that tells where it is in a loop",
            cause=f"{', '.join(without)}: nobody can ask such a device in a loop",
            advice=f"add such an axis to the machine; {NOTHING}",
        )
    found = tuple(name for name, axis in led.items() if not limp or "disable_torque" in axis.able)
    if not found:
        raise RequestError(
            "none of these axes can be taught by hand",
            expected="an axis that tells where it is and can be let go",
            advice=f"limp=False writes down what something else moves; {NOTHING}",
        )
    return found


class _Teaching:
    def __init__(self, rate: float, seconds: float | None, until: Callable[[], bool] | None) -> None:
        self._over = Ending(rate, seconds, until)
        self._axes: tuple[str, ...] = ()
        self._times: list[float] = []
        self._rows: list[tuple[float, ...]] = []

    def step(self, loop: LoopFace, state: LoopState) -> bool:
        """See `loop.Course`."""
        if not (state.missing or Quality.SUSPECT in state.doubts.values()):
            self._axes = loop.axes
            self._times.append(state.at)
            self._rows.append(tuple(state.position.values()))
        if self._over(state.number):
            return False
        if len(self._rows) < MOST:
            return True
        LOG.warning(
            "teaching ended after %.6g s: a trajectory has %d samples at most", self._over.seconds, MOST
        )
        return False

    def result(self, loop: LoopFace) -> Trajectory:
        """See `loop.Course`."""
        if len(self._rows) < 2:
            raise MotionError(
                f"{len(self._rows)} samples in {self._over.seconds:.3g} s are no trajectory",
                expected="two cycles or more in which every axis was heard",
                advice="teach longer, at a higher rate, or see why an axis is silent; the axes stay as they are",
            )
        return self._seen()

    def failed(self, error: MotorbusError) -> None:
        """See `loop.Errand`: what was taught goes along with what ended it."""
        if len(self._rows) >= 2:
            error.so_far = self._seen()

    def _seen(self) -> Trajectory:
        times = [at - self._times[0] for at in self._times]
        columns = zip(*self._rows, strict=True)
        return Trajectory(times, dict(zip(self._axes, columns, strict=True)))
