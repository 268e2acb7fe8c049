"""After a crash in the middle of a borrow: stop the motor, bring project 1 back, and see that it is.

The motor may be turning, and what is being edited may be as it was wanted, half of that, or, after a power cycle, what
is stored. All of it comes to the same: what the journal holds of project 1 is what it is brought back to. Nothing is
saved, as nothing was. Carrying this out again, after another crash in the middle of it, does no harm.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from motorbus.core.operation import REACHED, Alone, Journal, Operation, Report
from motorbus.errors import MotorbusError, RequestError
from motorbus.families.stepper.driver import characterising
from motorbus.families.stepper.driver.borrowing import GIVEN_BACK, NOTE, Loan, given_back, loan_of
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.stopping import stop

RESUMED: Final = "recovering"


def recover(node: Node, change: str, facts: Mapping[str, Any], *, alone: bool = False) -> Operation[str]:
    """Give project 1 back that was borrowed when the host was cut off: `change` its verb, `facts` as the journal says.

    Stops the motor first. Gives "old" when project 1 reads as it was. May be called again at any point. `alone` makes
    no difference: there is one controller on a line. A `characterise` that was cut off is ended likewise.

    Raises RequestError, with nothing sent, for facts of something else, or of a bus that was opened with another order
    of bytes; OutcomeUnknown when the stop is not accepted, for nothing is edited while the motor may turn; whatever
    writing and reading raise. The journal stays open then.
    """
    if change == characterising.VERB:
        return (yield from characterising.recovered(node, facts))
    loan = loan_of(change, facts)
    if loan.order != node.order:
        raise RequestError(
            f"project 1 was borrowed on a bus with dump_order={loan.order}, and this one has {node.order}",
            advice=f"open it with dump_order={loan.order}; nothing was sent",
            node=node.node,
        )
    try:
        return (yield from Alone(_recovered(node, loan, facts)))
    except BaseException as error:
        if not isinstance(error, MotorbusError):  # one of ours says itself what is wrong
            error.add_note(NOTE)
        raise


def _recovered(node: Node, loan: Loan, facts: Mapping[str, Any]) -> Operation[str]:
    told = {**loan.facts(node), REACHED: list(facts.get(REACHED, ()))}
    yield from Report(Journal(loan.verb, RESUMED, told))
    yield from stop(node)
    yield from given_back(node, loan)
    return GIVEN_BACK
