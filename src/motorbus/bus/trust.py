"""Which nodes may be believed. Decision record 0006.

A node is tainted before the first byte of a request to it leaves, and cleared only when its reply has been
accepted; so every other way out, an interrupt at any line included, leaves it tainted by construction. A tainted
node is left alone for a quiet time and then probed: an exchange with a known answer whose reply cannot be
confused with any reply still outstanding. Device and adapter are first-in first-out, so once that answer is here
nothing older can follow.
"""

from __future__ import annotations

from math import inf
from typing import Any, TypeAlias

from motorbus.core.family import Family
from motorbus.core.operation import ANY, Due, Exchange, Key

FORGOTTEN_AFTER = 5.0  # s; no device of any family answers this late, so the memory of a request may end
LONGEST_BACK_OFF = 1.0  # s between probes of a node that stays silent while a group is read
OUTSTANDING = 256  # kinds of reply remembered for a node that answers nothing
GROUP_RUN = 8  # group replies of one length in a row; another length costs a byte for each node
EQUAL_RUN = 128  # equal replies in a row from a node on CAN, where nothing but a probe shows that they are all one old
ATTEMPTS = 64  # probes looked at to find one that differs from all outstanding replies

Kind: TypeAlias = "tuple[int, Key, int]"
"""What a reply is known by: its lane, its key, its length."""
Look: TypeAlias = "tuple[Kind, int, Exchange[bool]]"
"""What a probe is known by, how many have been looked at with it, and the probe."""


class NodeTrust:
    """One node: may it be believed, what is still outstanding, when may it be probed."""

    __slots__ = (
        "asked_at",
        "attempt",
        "equal",
        "from_here",
        "key",
        "lane",
        "length",
        "oldest",
        "outstanding",
        "probe_at",
        "probes",
        "quiet_until",
        "run",
        "silent",
        "tainted",
    )

    def __init__(self) -> None:
        self.tainted = False
        self.lane = 0
        self.length = 0
        self.run = 0
        self.key: Key = None
        self.equal = 0
        self.asked_at = 0.0
        self.quiet_until = 0.0
        self.probe_at = 0.0
        self.silent = 0
        self.attempt = 0
        self.probes: list[Exchange[bool]] = []
        self.from_here: tuple[int, list[Look]] = -1, []  # where to look from, and what is looked at
        self.outstanding: dict[Kind, float] = {}
        self.oldest = inf  # s; none of those was asked before


class Trust:
    """The nodes of one bus."""

    def __init__(self, family: Family) -> None:
        self.family = family
        self.frames = family.link.kind == "frames"
        self.nodes: dict[int, NodeTrust] = {}

    def of(self, node: int) -> NodeTrust:
        """This node's state, a clean one when it was never asked."""
        trust = self.nodes.get(node)
        if trust is None:
            trust = self.nodes[node] = NodeTrust()
        return trust

    def ask(self, exchange: Exchange[Any], now: float) -> None:
        """A request is about to leave: taint every node that owes a reply."""
        if exchange.replies is not ANY:
            for due in exchange.replies:
                trust = self.of(due.node)
                trust.tainted = True
                trust.asked_at = now
                trust.lane = exchange.lane

    def missed(self, lane: int, due: Due, now: float, quiet: float) -> None:
        """This reply did not come in time and may still come."""
        trust = self.of(due.node)
        trust.outstanding[lane, due.key, due.length] = now
        if now < trust.oldest:
            trust.oldest = now
        if len(trust.outstanding) > OUTSTANDING:
            del trust.outstanding[next(iter(trust.outstanding))]
        trust.quiet_until = now + quiet

    def believe(self, *dues: Due, barrier: bool) -> None:
        """These replies are accepted. Only a probe (`barrier`) vouches for a node with replies outstanding.

        Nor does a long run of equal replies vouch for itself on CAN, where they have one length only: each might be
        the answer to the question before. So a run ends in a probe, which no older reply can answer.
        """
        nodes, frames = self.nodes, self.frames
        for due in dues:
            node, _, length = due
            trust = nodes[node]
            trust.run = trust.run + 1 if trust.length == length else 1
            trust.length = length
            if barrier:
                trust.outstanding.clear()
            if not trust.outstanding and not (frames and self._monotonous(trust, due, barrier)):
                trust.tainted = False
                trust.silent = 0

    def _monotonous(self, trust: NodeTrust, due: Due, barrier: bool) -> bool:
        """Has this node given the same kind of reply so often that it must be probed?"""
        trust.equal = trust.equal + 1 if trust.key == due.key and not barrier else 1
        trust.key = due.key
        return trust.equal >= EQUAL_RUN

    def alike(self, exchange: Exchange[Any]) -> bool:
        """Would the reply due look just like the last one? In a group that is let pass a few times, for its cost."""
        dues = exchange.replies
        if dues is ANY or not dues or dues[0].node not in self.nodes:
            return False
        trust = self.nodes[dues[0].node]
        return trust.length == dues[0].length and trust.run >= (1 if len(dues) == 1 else GROUP_RUN)

    def doubt(self, now: float, quiet: float, lane: int | None = None) -> None:
        """Bytes came that belong to nobody: whoever was asked lately (on this lane) may have sent them."""
        for trust in self.nodes.values():
            if lane in (None, trust.lane) and now - trust.asked_at <= quiet and not trust.tainted:
                trust.tainted = True
                trust.quiet_until = now + quiet

    def late(self, lane: int, key: Key, length: int) -> bool:
        """Is a reply of this kind outstanding from anyone? It is then no longer."""
        for trust in self.nodes.values():
            if trust.outstanding.pop((lane, key, length), None) is not None:
                return True
        return False

    def probe(self, node: int, now: float) -> Exchange[bool]:
        """The next probe of this node whose reply differs from every reply outstanding; else from the later ones."""
        trust = self.of(node)
        if now - trust.oldest > FORGOTTEN_AFTER:
            _forget(trust, now)
        if len(trust.probes) == ATTEMPTS:
            return _next_of_all(trust)
        oldest: tuple[float, Exchange[bool]] | None = None
        for _ in range(ATTEMPTS):
            exchange = self._made(node, trust)
            trust.attempt += 1
            asked_at = trust.outstanding.get(_kind(exchange))
            if asked_at is None:
                return exchange
            if oldest is None or asked_at < oldest[0]:
                oldest = asked_at, exchange
        assert oldest is not None
        return oldest[1]

    def _made(self, node: int, trust: NodeTrust) -> Exchange[bool]:
        """The probe of this attempt. They are kept, for of a node that answers nothing many are looked at each time,
        and made each time as many as there are: whoever needs the second one soon needs them all."""
        number, made = trust.attempt % ATTEMPTS, trust.probes
        if number == len(made):
            more = range(number, min(2 * number or 1, ATTEMPTS))
            made += [self.family.probe(node, attempt) for attempt in more]
        return made[number]

    def doubt_everyone(self, now: float, quiet: float) -> None:
        """The line to all of them was cut, and is there again: what is outstanding may still come, from now on."""
        for trust in self.nodes.values():
            trust.tainted = True
            trust.quiet_until = now + quiet
            trust.silent = 0
            trust.outstanding = dict.fromkeys(trust.outstanding, now)
            trust.oldest = min(trust.oldest, now)

    def stayed_silent(self, node: int, now: float, quiet: float) -> None:
        """A probe was not answered: leave the node alone, longer each time."""
        trust = self.of(node)
        trust.silent += 1
        trust.quiet_until = now
        trust.probe_at = now + min(quiet * 2.0 ** min(trust.silent, 10), LONGEST_BACK_OFF)


def _kind(probe: Exchange[bool]) -> Kind:
    """What its reply is known by."""
    ((_, key, length),) = probe.replies  # type: ignore[misc]  # a probe has exactly one reply
    return probe.lane, key, length


def _forget(trust: NodeTrust, now: float) -> None:
    """No reply comes as late as this."""
    for kind, asked in list(trust.outstanding.items()):
        if now - asked > FORGOTTEN_AFTER:
            del trust.outstanding[kind]
    trust.oldest = min(trust.outstanding.values(), default=inf)


def _next_of_all(trust: NodeTrust) -> Exchange[bool]:
    """`Trust.probe` where all of them have been made: of those with equal replies only the first is looked at."""
    place = trust.attempt % ATTEMPTS
    if trust.from_here[0] != place:
        trust.from_here = place, _in_order(trust.probes[place:] + trust.probes[:place])
    get, least, best = trust.outstanding.get, inf, trust.probes[place]
    for kind, looks, exchange in trust.from_here[1]:
        asked_at = get(kind)
        if asked_at is None:
            trust.attempt += looks
            return exchange
        if asked_at < least:
            least, best = asked_at, exchange
    trust.attempt += ATTEMPTS
    return best


def _in_order(probes: list[Exchange[bool]]) -> list[Look]:
    """The first of each kind, and how many have been looked at with it."""
    firsts: dict[Kind, Look] = {}
    for number, exchange in enumerate(probes, 1):
        kind = _kind(exchange)
        firsts.setdefault(kind, (kind, number, exchange))
    return list(firsts.values())
