"""After a crash in the middle of a borrow: stop the motor, bring project 1 back, and see that it is.

The motor may be turning, and what is being edited may be as it was wanted, half of that, or, after a power cycle, what
is stored. All of it comes to the same: what the journal holds of project 1 is what it is brought back to. Nothing is
saved, as nothing was. Carrying this out again, after another crash in the middle of it, does no harm.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from motorbus.core.steps import REACHED, Emit, Exclusive, JournalEntry
from motorbus.errors import MotorbusError, RequestError
from motorbus.families.stepper.driver import reading
from motorbus.families.stepper.driver.borrowing import GIVEN_BACK, NOTE, PROJECT, Loan, given_back, loan_of
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.owing import RUN, settled
from motorbus.families.stepper.driver.stopping import BY_HAND, ended
from motorbus.families.stepper.table import PROJECTS, Project, decode_image, differences

RESUMED: Final = "recovering"


async def recover(node: Node, change: str, facts: Mapping[str, Any], *, alone: bool = False) -> str:
    """Give project 1 back that was borrowed when the host was cut off: `change` its verb, `facts` as the journal says.

    Stops the motor first. Gives "old" when project 1 reads as it was. May be called again at any point. `alone` makes
    no difference: there is one controller on a line. A run of which nobody knows whether it
    has ended is stopped: "stopped".

    Raises RequestError, with nothing sent, for facts of something else, or of a bus that was opened with another order
    of bytes or another motor; RequestError, with nothing but the stop sent, when somebody has written project 1 since;
    OutcomeUnknown when the stop is not accepted, for nothing is edited while the motor may turn; whatever writing and
    reading raise. The journal stays open then.
    """
    if change == RUN:
        await ended(node)
        await settled(node, "stopped")
        return "stopped"
    loan = loan_of(change, facts)
    for name, then, now in (
        ("dump_order", loan.order, node.order),
        ("motor", facts.get("motor", node.motor), node.motor),
    ):
        if then != now:
            raise RequestError(
                f"project 1 was borrowed on a bus with {name}={then}, and this one has {now}",
                advice=f"open it with {name}={then}; nothing was sent",
                node=node.node,
            )
    try:
        return await Exclusive(_recovered(node, loan, facts))
    except BaseException as error:
        if not isinstance(error, MotorbusError):  # one of ours says itself what is wrong
            error.add_note(NOTE)
        raise


async def _recovered(node: Node, loan: Loan, facts: Mapping[str, Any]) -> str:
    told = {**loan.facts(node), REACHED: list(facts.get(REACHED, ()))}
    await Emit(JournalEntry(loan.verb, RESUMED, told))
    await ended(node, BY_HAND)
    await _refuse_written(node, loan)
    loan.cut = True  # it may have turned until now
    await given_back(node, loan)
    return GIVEN_BACK


async def _refuse_written(node: Node, loan: Loan) -> None:
    """Raise RequestError where project 1 reads neither as it was nor as it was lent: that is somebody's work.

    A borrow that was cut off before it was read back may have left another project's numbers under this number.
    """
    shown = await _project(node, PROJECT)
    strange = _unlike(shown, loan.before) & _unlike(shown, loan.wanted)
    if strange and not loan.seen:
        for number in range(PROJECT + 1, PROJECTS + 1):
            if not strange & _unlike(shown, await _project(node, number)):
                return
    if strange:
        raise RequestError(
            f"somebody has written project 1 since it was borrowed: {', '.join(sorted(strange))}",
            expected="each parameter as it was before, or as it was lent",
            cause="recover would put back what is older",
            advice="if it is as it should be, `motorbus recover BUS --forget` gives the borrow up; nothing was edited",
            node=node.node,
        )


async def _project(node: Node, number: int) -> Project:
    return decode_image(await reading.image(node, number), node.order)


def _unlike(shown: Project, other: Project) -> set[str]:
    """The names of the parameters in which they differ."""
    alike = replace(other, number=shown.number)
    return {f"step_{step}_{name}" if step else name for name, step, _, _ in differences(shown, alike)}
