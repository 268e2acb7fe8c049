"""`motorbus follow`: axes go where others are led by hand, for as long as somebody likes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from motorbus.cli.ending import asked_to_end
from motorbus.cli.exits import Exit
from motorbus.cli.machine import axes_named, machine
from motorbus.cli.moving import consent_to_far
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.rates import check_rate, time_of
from motorbus.cli.robot import place, robot
from motorbus.cli.teach import counted
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from motorbus.cli.output import Output
    from motorbus.cli.robot import InHand
    from motorbus.motion.clamping import Policy
    from motorbus.motion.follow import Followed

app = App(
    name="follow",
    usage="Usage: motorbus follow LEADER FOLLOWER [OPTIONS]",
    help_epilogue="""Both are an axis, or a group or bus of axes: the first axis of the one is
followed by the first of the other, and so on. Leaders are let go, so that they
can be led by hand: AN ARM SAGS, hold it. They stay limp. What has no torque
switch cannot be let go, and leads only when something else moves it: that is
told. A follower goes where its leader is, within its own velocity and
acceleration; while its leader stands where it may not go, it stays, or with
--clamp goes as far as it may; that is told.

Ends with Enter, with Ctrl-C or after --seconds; the followers brake then, and
keep their torque. Where the two are far apart at first, the follower has a
long way to go: more than 180 degrees need --yes.

Examples:

    motorbus follow left right
    motorbus follow shoulder elbow --seconds 10
    motorbus follow left right --rate 200 --dry-run""",
)


@app.default
def follow(
    leader: Annotated[str, Parameter(name="LEADER")],
    follower: Annotated[str, Parameter(name="FOLLOWER")],
    /,
    *,
    seconds: str | None = None,
    rate: float = 100.0,
    clamp: Flag = False,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Let axes go where others are led by hand.

    Parameters
    ----------
    leader
        An axis, a group or a bus of the machine file
    follower
        As many axes as those of the leader
    seconds
        How long, in s or as 1500ms; until Enter or Ctrl-C when left out.
    rate
        Cycles per second.
    clamp
        While a leader stands beyond the limits of its follower, go as far as these allow.
    yes
        Do not ask before a long way of a follower to its leader.
    options
        Any option of the buses, as a flag.
    """
    pairs = _pairs(leader, follower)
    span = None if seconds is None else time_of(seconds)
    check_rate(rate)
    with robot([*pairs, *pairs.values()], options, output) as hand:
        _judge(hand, pairs)
        present = {name: at for name, at in hand.robot.positions().items() if at is not None}
        if dry_run:
            return _plan(hand, pairs, present)
        goals = {one: present[other] for other, one in pairs.items() if other in present and one in present}
        _consent(hand, present, goals, clamp=clamp, yes=yes)
        _warn(hand, pairs)
        with hand.working("following"), asked_to_end() as ended:
            until = counted(hand, "following", ended, rate, span)
            policy: Policy = "clamp" if clamp else "reject"
            followed = hand.robot.follow(pairs, seconds=span, rate=rate, until=until, policy=policy)
    _tell(followed, output)
    return Exit.OK


def _pairs(leader: str, follower: str) -> dict[str, str]:
    """Follower by leader. Raises RequestError when they are not as many."""
    leaders, followers = axes_named((leader,)), axes_named((follower,))
    if len(leaders) != len(followers):
        raise RequestError(
            f"{leader} has {len(leaders)} axes and {follower} has {len(followers)}",
            expected="as many followers as leaders",
            advice="make groups of those that belong together, as [group.left]; nothing was sent",
        )
    return dict(zip(leaders, followers, strict=True))


def _judge(hand: InHand, pairs: Mapping[str, str]) -> None:
    """Raise RequestError for pairs that cannot be, before it is said that torque goes off."""
    from motorbus.motion.follow import check_pairs

    check_pairs(hand.robot, pairs)


def _warn(hand: InHand, pairs: Mapping[str, str]) -> None:
    """Say which leaders lose their torque, and which have none to lose."""
    limp = [name for name in pairs if hasattr(hand.robot[name], "disable_torque")]
    if limp:
        hand.output.note(f"{', '.join(limp)}: the torque goes off now, and stays off: hold what could sag")
    if stiff := [name for name in pairs if name not in limp]:
        hand.output.note(f"note: {', '.join(stiff)} cannot be let go: only what else moves it leads")


def _consent(
    hand: InHand, present: Mapping[str, float], goals: Mapping[str, float], *, clamp: bool, yes: bool
) -> None:
    """Ask before a follower goes far; one whose leader stands beyond its limits stays, or goes as far as they allow."""
    from motorbus.motion.clamping import kept

    axes = hand.robot.machine.axes
    wanted = {
        name: kept(name, axes[name], at, policy="clamp")[0] if clamp else at for name, at in goals.items()
    }
    consent_to_far(hand, present, {name: at for name, at in wanted.items() if axes[name].allows(at)}, yes=yes)


def _plan(hand: InHand, pairs: Mapping[str, str], present: Mapping[str, float]) -> Exit:
    """Who would follow whom, and how far it is."""
    facts = [
        {"leader": one, "follower": other, "leads_at": present.get(one), "follows_at": present.get(other)}
        for one, other in pairs.items()
    ]
    hand.output.document("motorbus.follow.plan/1", {"pairs": facts})
    rows = [
        (one, place(hand.robot, one, present.get(one)), other, place(hand.robot, other, present.get(other)))
        for one, other in pairs.items()
    ]
    hand.output.table("", ["leader", ">at", "follower", ">at"], rows)
    return Exit.OK


def _tell(followed: Followed, output: Output) -> None:
    axes, found = machine().axes, followed.statistics
    facts = [
        {"leader": one, "follower": other, "apart": followed.apart[other], "held": followed.held[other]}
        | {"clamped": found.clamped[other]}
        for one, other in followed.pairs.items()
    ]
    loop = {"cycles": found.cycles, "overruns": found.overruns, "skipped": found.skipped}
    output.document("motorbus.follow/1", {"seconds": followed.seconds, "pairs": facts, **loop})
    rows = [
        (one, other, axes[other].show(followed.apart[other]), followed.held[other])
        for one, other in followed.pairs.items()
    ]
    output.table("", ["leader", "follower", ">apart in the end", ">cycles held"], rows)
    output.text(
        f"{followed.seconds:.1f} s, {found.cycles} cycles, {found.overruns} overruns, {found.skipped} slots skipped"
    )
