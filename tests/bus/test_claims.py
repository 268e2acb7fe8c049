"""Who has the bus alone: in order, nested in one owner, and whatever line of it is interrupted."""

from __future__ import annotations

from motorbus.bus.claims import Claims
from motorbus.bus.ticket import Claim


def settle(claim: Claim) -> None:
    claim.finish()


def asking(*claims: Claim) -> Claims:
    found = Claims()
    found.waiting.extend(claims)
    return found


def test_the_first_gets_it_and_the_next_when_that_has_ended() -> None:
    first, second = Claim("a"), Claim("b")
    claims = asking(first, second)
    claims.grant(True, settle)
    assert (first.done, second.done, list(claims.waiting)) == (True, False, [second])
    assert claims.ours("a")
    assert claims.outside() == [second]
    assert claims.forget(first)
    claims.grant(True, settle)
    assert second.done
    assert claims.forget(second)
    assert not claims


def test_nobody_gets_it_while_something_flies() -> None:
    claims = asking(Claim("a"))
    claims.grant(False, settle)
    assert not claims.held


def test_what_is_nested_in_one_owner_is_granted_at_once_and_the_last_frees_it() -> None:
    outer, other, inner = Claim("a"), Claim("b"), Claim("a")
    claims = asking(outer, other, inner)
    claims.grant(True, settle)
    assert (outer.done, other.done, inner.done) == (True, False, True)
    assert not claims.forget(inner)
    assert claims.forget(outer)
    assert not claims.forget(outer), "said twice"


def test_a_claim_whose_granting_was_interrupted_is_granted_again_or_given_back() -> None:
    def interrupted(claim: Claim) -> None:
        raise KeyboardInterrupt

    for gives_up in (True, False):
        claim = Claim("a")
        claims = asking(claim)
        try:
            claims.grant(True, interrupted)
        except KeyboardInterrupt:
            assert not claim.done
        if gives_up:
            assert claims.forget(claim)
            assert not claims
        else:
            claims.grant(True, settle)
            assert claim.done
            assert (list(claims.waiting), list(claims.held)) == ([], [claim])


def test_who_only_waits_and_gives_up_frees_nothing() -> None:
    first, second = Claim("a"), Claim("b")
    claims = asking(first, second)
    claims.grant(True, settle)
    assert not claims.forget(second)
    assert claims.ours("a")
    assert claims
    assert claims.forget(first)
    assert not claims
    assert asking(second), "somebody waits"
