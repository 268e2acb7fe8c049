"""`motorbus teach replay follow`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from motorbus.cli.common import Common, Writing
from motorbus.cli.motion import For, agree, axes_of, far_moves, join_addresses, report, until_enter
from motorbus.cli.output import note
from motorbus.cli.target import need_machine, open_robot, parse_time
from motorbus.errors import RequestError

Rate = Annotated[float, Parameter(help="Cycles per s.")]


def teach(
    file: Annotated[str, Parameter(name="FILE")],
    /,
    *axes: Annotated[str, Parameter(name="AXIS")],
    for_: For = "",
    rate: Rate = 50.0,
    keep_torque: Annotated[bool, Parameter(help="Torque stays as it is.")] = False,
    common: Common = Common(),
) -> None:
    """Record axes that are moved by hand into a new CSV file.

    Torque is switched off and stays off: AN ARM SAGS, hold it. Without --for Enter
    or Ctrl-C ends it. If a device is lost, the recording until then is kept.

    Examples:

      motorbus teach wave.csv arm
      motorbus teach wave.csv shoulder elbow --for 10s --rate 100
      motorbus teach wave.csv --keep-torque --for 3s
    """
    from motorbus.motion.teach import teach_file

    if Path(file).exists():
        raise RequestError(f"{file} exists", advice="name another file, or delete it; nothing was sent")
    seconds = parse_time(for_)
    pressed = until_enter() if seconds is None else None
    with open_robot(common, axes) as robot:
        names = axes_of(robot, *axes) or None
        if not keep_torque:
            note("torque goes off now and stays off: hold what could sag")
        result = robot.carry_out(
            teach_file(
                robot, file, names=names, seconds=seconds, until=pressed, rate=rate, keep_torque=keep_torque
            )
        )
        report(robot, result, common)


def replay(
    file: Annotated[str, Parameter(name="FILE")],
    /,
    *,
    speed: Annotated[float, Parameter(help="Times as fast as recorded, above 0, at most 10.")] = 1.0,
    smooth: Annotated[float | None, Parameter(help="Remove what is quicker, in Hz.")] = None,
    repeat: Annotated[int, Parameter(help="How often.")] = 1,
    writing: Writing = Writing(),
    common: Common = Common(),
) -> None:
    """Play a recorded trajectory.

    All goals are checked against the limits before anything moves; then the axes
    move to the start together, and along the trajectory.

    Examples:

      motorbus replay wave.csv
      motorbus replay wave.csv --dry-run
      motorbus replay wave.csv --smooth 5 --speed 0.5 --repeat 3
    """
    from motorbus.motion.trajectory import Trajectory

    trajectory = Trajectory.load(file, need_machine(common).axes)
    with open_robot(common, tuple(trajectory.axes)) as robot:
        places = robot.positions()
        starts = trajectory.positions(0.0)
        far = far_moves(
            robot,
            {name: start - place for name, start in starts.items() if (place := places[name]) is not None},
        )
        action = f"move {far} to the start" if far else f"play {trajectory.duration / speed:.2f} s"
        if writing.dry_run:
            trajectory.check(robot.config.axes)
        if agree(action, writing, common, ask=bool(far)):
            played = robot.replay(trajectory, speed=speed, smooth=smooth, repeat=repeat)
            report(robot, played, common)


def follow(
    leader: Annotated[str, Parameter(name="LEADER")],
    follower: Annotated[str, Parameter(name="FOLLOWER")],
    /,
    *,
    for_: For = "",
    rate: Rate = 100.0,
    writing: Writing = Writing(),
    common: Common = Common(),
) -> None:
    """Let the axes of FOLLOWER track those of LEADER, in the order of the file.

    Torque of the leaders is switched off: AN ARM SAGS, hold it. Followers keep to
    their own limits. Without --for Enter ends it; the followers brake and hold.

    Examples:

      motorbus follow left right
      motorbus follow shoulder elbow --for 10s
      motorbus follow left right --rate 200 --yes
    """
    seconds = parse_time(for_)
    pressed = None if seconds is not None or writing.dry_run else until_enter()
    with open_robot(common, join_addresses((leader, follower))) as robot:
        leaders, followers = axes_of(robot, leader), axes_of(robot, follower)
        if len(leaders) != len(followers):
            raise RequestError(
                f"{leader} has {len(leaders)} axes and {follower} has {len(followers)}",
                expected="as many followers as leaders",
                advice="make a [group.NAME] of each side",
            )
        pairs = dict(zip(leaders, followers, strict=True))
        action = f"switch torque of {', '.join(leaders)} off, and move {', '.join(followers)}"
        if agree(action, writing, common):
            report(robot, robot.follow(pairs, seconds=seconds, until=pressed, rate=rate), common)
