"""A good machine file, what is wrong with others that are nearly it, and any machine that a file can describe.

Each broken file has one thing wrong. `says` is how its message begins (the place in the file and what is there), `fix`
what it must offer, and `schema` whether a JSON Schema can see it too.
"""

from __future__ import annotations

from typing import Any, NamedTuple, get_args

from hypothesis import strategies as st

from motorbus.motion.machine import AxisSpec, BusSpec, GroupSpec, Machine
from motorbus.motion.machine.model import Estop, Exit

GOOD = """\
# The bench in the cellar.
format = 1
name = "bench"

[bus.arm]                       # behind the left adapter
address = "feetech:/dev/ttyACM0,baud=1000000"
[bus.gimbal]
address = "kst:can://slcan/dev/ttyACM1,bitrate=500000"

# The shoulder was replaced in March.
[axis.shoulder]
device = "arm#1"
zero = "180 deg"                # measured by hand
sign = -1
gear = 3.0
unit = "deg"
low = "-90 deg"
high = "90 deg"
max_velocity = "120 deg/s"
max_acceleration = "500 deg/s2"
max_step = "10 deg"
exit = "hold"
torque = 0.5

# Handle with care.
[axis.elbow]
device = "arm#2"
low = "-2 rad"
high = "2 rad"
exit = "park"
park = "0 deg"
current = "0.4 A"
guard = false

[axis.slide]
device = "gimbal#0x25"
travel = "5 mm"
low = "0 mm"
high = "120 mm"

[group.left]
axes = ["shoulder", "elbow"]    # top to bottom

[pose.ready]
shoulder = "10 deg"             # up
elbow = "-20 deg"
slide = "30 mm"
"""


class Broken(NamedTuple):
    """A file that must be refused: `old` in the good one is replaced by `new`."""

    old: str
    new: str
    says: str
    fix: str
    schema: bool = True

    @property
    def text(self) -> str:
        """The whole file."""
        assert GOOD.count(self.old) == 1, self.old
        return GOOD.replace(self.old, self.new)


class NoText(NamedTuple):
    """What is in a file that is no text at all, and how its message goes on behind `it is no text: `."""

    content: bytes
    says: str


NO_TEXT = {
    "utf-16": NoText(GOOD.encode("utf-16"), "invalid start byte"),
    "utf-16-without-mark": NoText(GOOD.encode("utf-16-le"), "there are zero bytes in it"),
    "binary": NoText(bytes(range(256)), "invalid start byte"),
    "cut-off": NoText(GOOD.encode() + b"\xc3", "unexpected end of data"),
}

DEEP = "zero" + ".a" * 3000 + " = 1"
BROKEN = (
    # the file itself
    Broken("format = 1\n", "", "format: is missing", "make it the first line"),
    Broken("format = 1", "format = 2", "format: 2 is not known", "update motorbus"),
    Broken("format = 1", 'format = "1"', "format: '1' is not known", "write format = 1"),
    Broken('low = "-90 deg"', "low = -90 deg", "the file is no TOML: ", "stands in quotes", False),
    Broken("sign = -1", "sign = -1\nsign = 1", "the file is no TOML: ", "each key in its table once", False),
    Broken("[axis.elbow]", "[axis.shoulder]", "the file is no TOML: ", "each [table] stands in a file once", False),
    Broken("gear = 3.0", "gear = " + "[" * 3000, "the file is no TOML: it is nested", "TOML", False),
    Broken("gear = 3.0", "gear = " + "9" * 5000, "the file is no TOML: a number has thousands", "TOML", False),
    Broken("format = 1", "format = 1\nspeed = 3", "speed: there is no such key", "one of format, name, bus"),
    Broken("[group.left]", "[groups.left]", "groups: there is no such key", "did you mean group?"),
    Broken('name = "bench"', "name = 7", "name: 7 is no name of a machine", "text in quotes"),
    Broken('name = "bench"', f'name = "{"x" * 201}"', "name: 'xxx", "200 characters"),
    # names
    Broken("[axis.slide]", "[axis.Slide]", "axis.Slide: the name has other characters", "call it slide"),
    Broken("[bus.gimbal]", '[bus."gim bal"]', 'bus."gim bal": the name has', "call it gim_bal"),
    Broken("[pose.ready]", '[pose.""]', 'pose."": the name is empty', "a lower case letter"),
    Broken("[group.left]", "[group.slide]", "group.slide: this is the name of axis.slide too", "slide_group", False),
    # buses
    Broken('address = "feetech:/dev/ttyACM0,baud=1000000"', "", "bus.arm.address: is missing", "FAMILY:PORT"),
    Broken("feetech:/dev/ttyACM0,", "feetech:,", "bus.arm.address: 'feetech:,baud", "FAMILY:PORT"),
    Broken("feetech:/dev/ttyACM0,", "/dev/ttyACM0,", "bus.arm.address: '/dev/ttyACM0,baud", "FAMILY:PORT"),
    Broken(",baud=1000000", "#3", "bus.arm.address: 'feetech:/dev/ttyACM0#3'", "it stands in an axis"),
    Broken("address = \"kst", "adress = \"kst", "bus.gimbal.adress: there is no such key", "did you mean address?"),
    Broken('[bus.gimbal]\naddress', 'bus.gimbal', "bus.arm.bus: there is no such key", "address"),
    Broken("[bus.gimbal]\naddress", "[bus]\ngimbal", "bus.gimbal: 'kst:can:", "a table [bus.gimbal]"),
    # devices
    Broken('device = "arm#2"', "", "axis.elbow.device: is missing", "BUS#ID"),
    Broken('"arm#2"', "2", "axis.elbow.device: 2 is no device", "BUS#ID"),
    Broken("arm#2", "arm2", "axis.elbow.device: 'arm2' is no device", 'as "arm#1"'),
    Broken("arm#2", "arms#2", "axis.elbow.device: there is no bus arms", "did you mean arm?", False),
    Broken("arm#2", "arm#0x1", "axis.elbow.device: arm#0x1 moves axis.shoulder already", "change the id", False),
    Broken("arm#2", "arm#4294967295", "axis.elbow.device: 4294967295 is no id", "0 to 2147483647", False),
    # keys and values of axes
    Broken("max_velocity", "max_velocty", "axis.shoulder.max_velocty: there is no", "did you mean max_velocity?"),
    Broken("sign = -1", "sign = 0", "axis.shoulder.sign: 0 is not possible", "one of 1, -1"),
    Broken("sign = -1", "sign = true", "axis.shoulder.sign: true is not possible", "one of 1, -1"),
    Broken("gear = 3.0", "gear = 0", "axis.shoulder.gear: 0 is out of range", "1e-06 to 1000"),
    Broken("gear = 3.0", 'gear = "3:1"', "axis.shoulder.gear: '3:1' is no finite number", "a number"),
    Broken("gear = 3.0", "gear = nan", "axis.shoulder.gear: nan is no finite number", "a number", False),
    Broken('unit = "deg"', 'unit = "grad"', "axis.shoulder.unit: 'grad' is not possible", "did you mean rad?"),
    Broken('unit = "deg"', 'unit = "mm"', "axis.shoulder.unit: 'mm' is not possible", "when it has travel"),
    Broken('zero = "180 deg"', 'zero = "180 grd"', "axis.shoulder.zero: position '180 grd' has", "deg"),
    Broken('zero = "180 deg"', 'zero = ""', "axis.shoulder.zero: position '' is empty", "a number"),
    Broken('zero = "180 deg"', 'zero = "2048 raw"', "axis.shoulder.zero: position '2048 raw'", "with one of rad"),
    Broken('zero = "180 deg"', DEEP, "axis.shoulder.zero: a table is no position", "a finite number with its unit"),
    Broken('zero = "180 deg"', "zero = {deg = 180}", "axis.shoulder.zero: a table is no position", 'zero = "180 deg"'),
    Broken('low = "-2 rad"', "low = inf", "axis.elbow.low: inf is no position", "a finite number with"),
    Broken('low = "-2 rad"', "low = 2024-05-01", "axis.elbow.low: '2024-05-01' is no position", "a finite number"),
    Broken('low = "-2 rad"', 'low = "-20 mm"', "axis.elbow.low: position '-20 mm' has the unit", 'has travel = "5 mm"'),
    Broken('low = "0 mm"', 'low = "0 deg"', "axis.slide.low: length '0 deg' has the unit", "leave travel out"),
    Broken('low = "0 mm"', 'low = "1,5 mm"', "axis.slide.low: length '1,5 mm' has a decimal comma", "point"),
    Broken('travel = "5 mm"', 'travel = "0 mm"', "axis.slide.travel: '0 mm' is out of range", "1e-06 to 1000", False),
    Broken('"120 deg/s"', '"120 deg"', "axis.shoulder.max_velocity: velocity '120 deg' has", "deg/s"),
    Broken('"120 deg/s"', '"-120 deg/s"', "axis.shoulder.max_velocity: '-120 deg/s' is out", "above 0"),
    Broken('"500 deg/s2"', '"0 deg/s2"', "axis.shoulder.max_acceleration: '0 deg/s2' is out", "above 0", False),
    # bare numbers
    Broken('low = "-90 deg"', "low = -90", "axis.shoulder.low: -90 has no unit", 'write low = "-90 deg" (-1.5708 rad)'),
    Broken('low = "-90 deg"', 'low = "-90"', "axis.shoulder.low: -90 has no unit", 'or low = "-90 rad" (-5156.62 deg)'),
    Broken('zero = "180 deg"', "zero = 0", "axis.shoulder.zero: 0 has no unit", 'zero = "0 deg"'),
    Broken('"120 deg/s"', "120", "axis.shoulder.max_velocity: 120 has no", 'write max_velocity = "120 deg/s"'),
    Broken('"500 deg/s2"', "500", "axis.shoulder.max_acceleration: 500 has no unit", '"500 rad/s2" (28647.9 deg/s2)'),
    Broken('max_step = "10 deg"', "max_step = 10", "axis.shoulder.max_step: 10 has no unit", 'max_step = "10 deg"'),
    Broken('park = "0 deg"', "park = 0.5", "axis.elbow.park: 0.5 has no unit", 'park = "0.5 rad" (28.6479 deg)'),
    Broken('high = "120 mm"', "high = 120", "axis.slide.high: 120 has no unit", 'high = "120 mm" (0.12 m)'),
    Broken('travel = "5 mm"', "travel = 5", "axis.slide.travel: 5 has no unit", 'travel = "5 mm"'),
    Broken('elbow = "-20 deg"', "elbow = -20", "pose.ready.elbow: -20 has no unit", 'elbow = "-20 deg"'),
    Broken('exit = "hold"', 'exit = "torque-off"', "axis.shoulder.exit: 'torque-off' is", "did you mean torque_off?"),
    Broken("guard = false", 'guard = "no"', "axis.elbow.guard: 'no' is not possible", "true"),
    Broken("guard = false", "guard = 0", "axis.elbow.guard: 0 is not possible", "write it as guard = false"),
    Broken("torque = 0.5", "torque = 50", "axis.shoulder.torque: 50 is out of range", 'write "50 %"'),
    Broken('"0.4 A"', '"0.4 V"', "axis.elbow.current: current '0.4 V' has the unit", "A, mA"),
    Broken('"0.4 A"', "[0.4]", "axis.elbow.current: a list is no current", "a finite number in A"),
    Broken("[axis.slide]", "[[axis.slide]]", "axis.slide: a list is no table", "a table [axis.slide]"),
    # limits
    Broken('low = "-90 deg"', 'low = "91 deg"', "axis.shoulder.low: 91.0 deg is above high", "exchange the two", False),
    Broken('low = "-90 deg"', 'low = "90 deg"', "axis.shoulder.high: it is 90.0 deg like low", "more than 90", False),
    Broken('low = "0 mm"\n', "", "axis.slide.low: is missing, and high is there", "both, or none"),
    Broken('park = "0 deg"\n', "", 'axis.elbow.park: is missing, and exit is "park"', 'park = "0 deg"'),
    Broken('park = "0 deg"', 'park = "1 turn"', "axis.elbow.park: 360.0 deg is outside", "-114.6 deg to 114.6", False),
    Broken('current = "0.4 A"', 'current = 1\ntorque = 1', "axis.elbow.current: torque is there too", "take one"),
    # groups and poses
    Broken('["shoulder", "elbow"]', '"shoulder"', "group.left.axes: 'shoulder' is no list", 'axes = ["shoulder"'),
    Broken('["shoulder", "elbow"]', "[]", "group.left.axes: it names no axis", 'axes = ["shoulder"'),
    Broken('["shoulder", "elbow"]', "[1]", "group.left.axes[0]: 1 is no name", "names stand in quotes"),
    Broken('["shoulder", "elbow"]', '["sholder"]', "group.left.axes[0]: there is no axis", "mean shoulder?", False),
    Broken('"shoulder", "elbow"', '"elbow", "elbow"', "group.left.axes[1]: elbow is named twice", "take one of them"),
    Broken('axes = ["sh', 'axis = ["sh', "group.left.axis: there is no such key", "axes"),
    Broken('elbow = "-20 deg"', 'elbo = "-20 deg"', "pose.ready.elbo: there is no axis 'elbo'", "mean elbow?", False),
    Broken('"30 mm"', '"130 mm"', "pose.ready.slide: 130.00 mm is outside the limits", "0.00 mm to 120.00 mm", False),
    Broken('"30 mm"', '"30 deg"', "pose.ready.slide: length '30 deg' has the unit", "leave travel out", False),
)  # fmt: skip

FEETECH, KST = "feetech:/dev/ttyACM0,baud=1000000", "kst:can://slcan/dev/ttyACM1,bitrate=500000"
UNOPENABLE = (
    # read without a fault; whoever knows the families sees before anything is opened that it cannot be
    Broken(FEETECH, "feetech:sim,bauds=3", "bus.arm.address: 'feetech:sim,bauds=3': unknown", "did you mean baud?"),
    Broken(FEETECH, "feetech:sim,id=1", "bus.arm.address: 'feetech:sim,id=1': unknown option 'id'", "mean ids?"),
    Broken(FEETECH, "feetech:sim,colour=1", "bus.arm.address: 'feetech:sim,colour=1'", "take it out of the address"),
    Broken("baud=1000000", "latncy=0", "bus.arm.address: 'feetech:/dev/ttyACM0,latncy=0'", "did you mean latency?"),
    Broken("baud=1000000", "baud=fast", "bus.arm.address: baud=fast: not a rate", "bit/s, as 500000"),
    Broken("baud=1000000", "latency=x", "bus.arm.address: latency=x: time 'x' is not", "change it in the address"),
    Broken("baud=1000000", "reconnect=1", "bus.arm.address: reconnect=1: neither yes nor no", "yes or no"),
    Broken("bitrate=500000", "profile=xq", "bus.gimbal.address: profile=xq is not possible", "one of kst, "),
    Broken("bitrate=500000", "sized=2", "bus.gimbal.address: sized=2 is not possible", "one of no, yes"),
    # values that simulated devices cannot have
    Broken(FEETECH, "feetech:sim,model=zzz", "bus.arm.address: there is no simulated FEETECH model 'zzz'", "lists"),
    Broken(FEETECH, "feetech:sim,model=sts3216", "bus.arm.address: there is no simulated FEETECH", "perhaps sts3215"),
    Broken(FEETECH, "feetech:sim,ids=abc", "bus.arm.address: ids 'abc': 'abc' is not a number", "1-6"),
    Broken(FEETECH, "feetech:sim,ids=250-254", "bus.arm.address: id 254 is not possible", "0 to 253"),
    Broken(FEETECH, "feetech:sim,position=1_0", "bus.arm.address: option position: '1_0' is not", "-1 to 4095"),
    Broken(FEETECH, "feetech:sim,startup_time=abc", "bus.arm.address: option startup_time: 'abc'", "a number, 0"),
    Broken(FEETECH, "feetech:sim,faults=at 1 s: power-cycle 9", "bus.arm.address: fault 'at 1 s", "one of 1"),
    Broken(KST, "kst:sim,model=zzz", "bus.gimbal.address: there is no simulated KST profile 'zzz'", "one of kst, "),
    Broken(KST, "kst:sim,flash_cut=half", "bus.gimbal.address: option flash_cut: 'half' is", "one of old, new"),
    Broken(KST, "stepper:sim,ids=2", "bus.gimbal.address: a stepper line has one controller, not 2", "a line for each"),
    # families, ports and channels
    Broken("feetech:/dev", "fetech:/dev", "bus.arm.address: there is no family 'fetech'", "one of feetech, kst"),
    Broken("slcan/dev", "slcn/dev", "bus.gimbal.address: 'can://slcn/dev/ttyACM1'", "did you mean slcan?"),
    Broken(KST, "kst:/dev/ttyACM0", "bus.gimbal.address: /dev/ttyACM0 is the port of bus.arm too", "one bus"),
    Broken("ttyACM1", "ttyACM0", "bus.gimbal.address: /dev/ttyACM0 is the port of bus.arm too", "a port for each"),
    # devices
    Broken("arm#2", "arm#254", "axis.elbow.device: 254 is not the id of a servo", "0 to 253"),
    Broken("arm#2", "arm#300", "axis.elbow.device: 300 is not the id of a servo", f"`motorbus scan {FEETECH}`"),
    Broken("#0x25", "#200", "axis.slide.device: 200 is not the id of a servo", "1 to 127"),
    Broken("#0x25", "#0", "axis.slide.device: 0 is not the id of a servo", "0 addresses all servos"),
    Broken('low = "0 mm"', 'estop = "torque_off"\nlow = "0 mm"', "axis.slide.estop: an emergency", "take estop out"),
    Broken('low = "0 mm"', 'exit = "torque_off"\nlow = "0 mm"', "axis.slide.exit: gimbal#0x25 (kst)", 'exit = "hold"'),
)  # fmt: skip


def axis(**other: Any) -> AxisSpec:
    """A plain axis that turns, where nothing else is said."""
    usual = {"device": "arm#1", "unit": "deg", "max_velocity": 1.5, "max_acceleration": 6.0}
    return AxisSpec(**{**usual, **other})


def _positions(linear: bool) -> st.SearchStrategy[float]:
    farthest = 10.0 if linear else 1000.0
    return st.floats(-farthest, farthest)


@st.composite
def axes(draw: st.DrawFn, device: str = "arm#1") -> AxisSpec:
    """Any axis that a file can describe."""
    linear = draw(st.booleans())
    positions = _positions(linear)
    low, high = sorted(draw(st.lists(positions, min_size=2, max_size=2, unique=True)))
    limits = draw(st.sampled_from([{}, {"low": low, "high": high}]))
    inside = st.floats(low, high)
    exit_: Exit = draw(st.sampled_from(get_args(Exit)))
    estop: Estop | None = draw(st.sampled_from([None, *get_args(Estop)]))
    caps = [{}, {"torque": draw(st.floats(1e-3, 1))}, {"current": draw(st.floats(1e-3, 100))}]
    return AxisSpec(
        device=device,
        zero=draw(_positions(False)),
        sign=draw(st.sampled_from([1, -1])),
        gear=draw(st.floats(1e-3, 1e3)),
        travel=draw(st.floats(1e-4, 10)) if linear else None,
        unit=draw(st.sampled_from(["mm", "m"] if linear else ["deg", "rad", "turn"])),
        max_velocity=draw(st.floats(1e-3, 1e3)),
        max_acceleration=draw(st.floats(1e-3, 1e3)),
        max_step=draw(st.none() | st.floats(1e-3, 1e3)),
        exit=exit_,
        estop=estop,
        guard=draw(st.booleans()),
        park=draw(inside) if exit_ == "park" else None,
        **limits,
        **draw(st.sampled_from(caps)),
    )


@st.composite
def machines(draw: st.DrawFn) -> Machine:
    """Any machine that a file can describe, of at most four axes."""
    count = draw(st.integers(0, 4))
    moved = {f"axis-{number}": draw(axes(f"arm#{number}")) for number in range(count)}
    some = draw(st.lists(st.sampled_from(sorted(moved)), unique=True)) if moved else []
    pose = {name: moved[name].low or 0.0 for name in some if moved[name].allows(moved[name].low or 0.0)}
    return Machine(
        name=draw(st.text(st.characters(exclude_categories=["Cs"]), max_size=20)),
        buses={"arm": BusSpec(address="feetech:/dev/ttyACM0,baud=1M")},
        axes=moved,
        groups={"some": GroupSpec(axes=tuple(some))} if some else {},
        poses={"rest": pose} if pose else {},
    )
