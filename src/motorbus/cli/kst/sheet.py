"""`motorbus kst eds`: an electronic data sheet for any CANopen tool. Opens no port."""

from __future__ import annotations

from pathlib import Path

from motorbus.cli.exits import Exit
from motorbus.cli.files import usable
from motorbus.cli.kst.identity import whole
from motorbus.cli.kst.servo import app
from motorbus.cli.parameters import Flag, Silent
from motorbus.errors import RequestError
from motorbus.families.kst import Node
from motorbus.families.kst.profiles import PROFILES


@app.command(
    help_epilogue="""Written from the same rows as everything else. --with-mandatory declares three
objects that CiA 301 demands and these servos lack, for tools that insist.

Examples:

    motorbus kst eds --output kst.eds
    motorbus kst eds --profile xqpower --with-mandatory > xqpower.eds""",
)
def eds(
    *,
    profile: str = "kst",
    node: str = "0x25",
    with_mandatory: Flag = False,
    output_: Path | None = None,
    output: Silent,
) -> Exit:
    """Write an electronic data sheet (CiA 306) of these servos.

    Parameters
    ----------
    profile
        kst, kst-ext, kingmax or xqpower
    node
        The node id that it declares.
    with_mandatory
        Declare the objects of CiA 301 that these servos do not have.
    output_
        A file to write; stdout when left out.
    """
    from motorbus.families.kst.eds import eds as made

    if profile not in PROFILES:
        raise RequestError(f"there is no profile {profile!r}", expected=f"one of {', '.join(PROFILES)}")
    number = Node(whole(node, "an id")).node
    name = output_.name if output_ else ""
    text = made(PROFILES[profile], node_id=number, with_mandatory=with_mandatory, file_name=name)
    if output_ is not None:
        with usable(output_, "written"):
            output_.write_text(text, encoding="ascii", newline="\r\n")
    facts = {"profile": profile, "file": str(output_) if output_ else None}
    output.document("motorbus.kst.eds/1", {**facts, **({} if output_ else {"eds": text})})
    output.text(f"written: {output_}" if output_ else text.rstrip("\n"))
    return Exit.OK
