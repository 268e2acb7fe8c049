"""What the events of this family say to people."""

from __future__ import annotations

from motorbus.families.stepper import EditsLost, Sends, Slowing, Unrecorded


def say(event: object) -> str:
    """What an event says in words, "" for one that says nothing.

    Nothing is sent to find a controller without telling which frame it is.
    """
    if isinstance(event, Sends) and isinstance(event.request, bytes):
        sent = event.request.hex(" ").upper()
        return f"to find out who is there, this is sent and nothing else: {sent} (read project 1)"
    if isinstance(event, EditsLost):
        lost = "; ".join(map(str, event.changes))
        return f"selecting project {event.project} has loaded what is stored of it; edits not saved are lost: {lost}"
    if isinstance(event, Slowing):
        return (
            f"the motor gets {event.seconds:.3g} s to come to rest before project 1 is given back; "
            "Ctrl-C again leaves it borrowed: `recover` gives it back"
        )
    if isinstance(event, Unrecorded):
        return f"{event.how}, but the journal could not be told: {event.why}; say `motorbus stop` once it can"
    return ""
