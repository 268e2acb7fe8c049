"""A good trajectory file, and others that are nearly one: each has one thing wrong.

`says` is how its message begins (line, column and what is there), and `fix` what it must offer.
"""

from __future__ import annotations

from typing import NamedTuple

from motorbus.motion.machine import AxisSpec

AXES = {
    "shoulder": AxisSpec(device="arm#1", unit="deg", max_velocity=2.0, max_acceleration=9.0),
    "elbow": AxisSpec(device="arm#2", unit="rad", max_velocity=2.0, max_acceleration=9.0),
    "slide": AxisSpec(device="arm#3", unit="mm", travel=0.005, max_velocity=0.1, max_acceleration=1.0),
}
GOOD = """\
# A trajectory of motorbus: format = 1
# recorded on a Tuesday

time (s),shoulder (deg),slide (mm)
0,0,0
0.5,90,12.5
# here it waits
1.5,90,12.5
"""


class Broken(NamedTuple):
    """A file that is none."""

    text: str
    says: str
    fix: str


BROKEN: dict[str, Broken] = {
    "empty": Broken("", "line 1: the header is missing", "name the columns"),
    "only-comments": Broken("# hello\n\n", "line 1: the header is missing", "name the columns"),
    "no-header": Broken("0,1\n1,2\n", "line 1: the header is missing", "name the columns"),
    "semicolons": Broken("time;shoulder\n0;1\n", "line 1: there is one column", "separate columns by commas"),
    "tabs": Broken("time\tshoulder\n0\t1\n", "line 1: there is one column", "separate columns by commas"),
    "no-time": Broken(
        "shoulder,slide\n0,1\n1,2\n",
        "line 1, column 1: 'shoulder' is not time",
        "make time the first column",
    ),
    "time-in-degrees": Broken(
        "time (deg),shoulder\n0,1\n", "line 1, column 1: time has the unit 'deg'", "give a unit"
    ),
    "only-time": Broken("time (s)\n0\n1\n", "line 1: no axis is named", "add a column"),
    "unknown-axis": Broken(
        "time,sholder (deg)\n0,1\n", "line 1, column 2: there is no axis 'sholder'", "did you mean shoulder?"
    ),
    "axis-twice": Broken(
        "time,elbow,slide,elbow\n0,1,2,3\n", "line 1, column 4: elbow is there twice", "take one of them out"
    ),
    "no-name": Broken("time,,slide\n0,1,2\n", "line 1, column 2: the column has no name", "in brackets"),
    "only-a-unit": Broken("time,(deg)\n0,1\n", "line 1, column 2: '(deg)' is no name", "in brackets"),
    "open-bracket": Broken("time,elbow (deg\n0,1\n", "line 1, column 2: 'elbow (deg' is no", "in brackets"),
    "unknown-unit": Broken(
        "time,elbow (dge)\n0,1\n", "line 1, column 2: elbow has the unit 'dge'", "did you mean deg?"
    ),
    "length-of-a-turning-axis": Broken(
        "time,elbow (mm)\n0,1\n", "line 1, column 2: elbow has the unit 'mm'", "give a unit that measures it"
    ),
    "angle-of-a-linear-axis": Broken(
        "time,slide (deg)\n0,1\n", "line 1, column 2: slide has the unit 'deg'", "give a unit"
    ),
    "word": Broken("time,elbow\n0,up\n", "line 2, column 2 (elbow): 'up' is no number", "in the header"),
    "unit-in-a-cell": Broken(
        "time,elbow (deg)\n0,1\n1,90 deg\n",
        "line 3, column 2 (elbow): '90 deg' is no number",
        "in the header",
    ),
    "python-number": Broken(
        "time,elbow\n0,1_000\n", "line 2, column 2 (elbow): '1_000' is no number", "in the header"
    ),
    "gap": Broken("time,elbow\n0,1\n1,\n", "line 3, column 2 (elbow): the number is missing", "fill the gap"),
    "not-a-number": Broken("time,elbow\n0,nan\n", "line 2, column 2 (elbow): nan is out of range", "correct"),
    "infinite": Broken("time,elbow\n0,-inf\n", "line 2, column 2 (elbow): -inf is out of range", "correct"),
    "far-away": Broken("time,elbow\n0,1e7\n", "line 2, column 2 (elbow): 1e7 is out of range", "correct"),
    "time-is-a-word": Broken(
        "time,elbow\n0,1\nlater,2\n", "line 3, column 1 (time): 'later' is no number", "in the header"
    ),
    "time-stands": Broken(
        "time,elbow\n0,1\n1,2\n1,3\n", "line 4, column 1 (time): 1 is not after the row", "sort the rows"
    ),
    "time-runs-back": Broken(
        "time,elbow\n0,1\n\n# x\n-1,2\n", "line 5, column 1 (time): -1 is not after the row", "sort the rows"
    ),
    "short-row": Broken("time,elbow,slide\n0,1\n", "line 2: there are 2 columns", "add slide"),
    "long-row": Broken("time,elbow\n0,1,2\n", "line 2: there are 3 columns", "with a point"),
    "decimal-comma": Broken("time,elbow\n0,5,1\n", "line 2: there are 3 columns", "not with a comma"),
    "row-of-one": Broken("time,elbow\n0,1\n1\n", "line 3: there is 1 column", "add elbow"),
    "no-rows": Broken("time,elbow\n", "line 1: there are no rows", "add a row"),
    "one-row": Broken("time,elbow\n0,1\n", "line 2: there is one row", "add a row"),
    "newer-format": Broken(
        "# format = 2\ntime,elbow\n0,1\n1,2\n", "line 1: format '2' is not known", "update motorbus"
    ),
    "nonsense-format": Broken(
        "# format = one\ntime,elbow\n0,1\n1,2\n", "line 1: format 'one' is not known", "update motorbus"
    ),
}
