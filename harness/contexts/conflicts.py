"""Finds records that contradict each other, and records replaced by newer ones. Pure: decides for neither side."""

from collections.abc import Mapping, Sequence

import msgspec

from harness.contracts.reasons import Reason, because

TOLERANCES = {"_m": 0.5, "_rad": 0.35, "_share": 0.1}


class Statement(msgspec.Struct, frozen=True):
    """What one source asserts at one instant. `human`: a person's statement, which disambiguates.

    `subject`: what it is about; empty = later ones of its source do not replace it.
    """

    source: str
    at_s: float
    human: bool
    subject: str
    states: Mapping[str, float | str]


def superseded(statements: Sequence[Statement]) -> dict[int, Reason]:
    """Indices of statements that the same source, or a person on the same names, later replaced; and why."""
    old: dict[int, Reason] = {}
    replacing = [one for one in statements if one.subject or one.human]
    for index, statement in enumerate(statements):
        for newer in replacing:
            if newer.at_s <= statement.at_s:
                continue
            if statement.subject and (statement.subject, statement.source) == (newer.subject, newer.source):
                old[index] = because("observed_again", source=newer.source, at_s=newer.at_s)
            elif newer.human and _contradiction(statement, newer):
                old[index] = because("settled_by", source=newer.source, at_s=newer.at_s)
    return old


def conflicting(statements: Sequence[Statement], *, ignored: frozenset[int]) -> dict[int, Reason]:
    """Indices of statements by different sources that contradict each other, and what about."""
    torn: dict[int, Reason] = {}
    live = [(index, one) for index, one in enumerate(statements) if one.states and index not in ignored]
    for index, statement in live:
        for _, other in live:
            name = _contradiction(statement, other) if other.source != statement.source else ""
            if name:
                torn[index] = because(
                    "contradicted_by",
                    name=name,
                    stated=statement.states[name],
                    against=other.states[name],
                    source=other.source,
                )
                break
    return torn


def _contradiction(one: Statement, other: Statement) -> str:
    """The first name that both assert and differ on beyond its unit's tolerance; empty if they agree."""
    for name in sorted(one.states.keys() & other.states.keys()):
        mine, theirs = one.states[name], other.states[name]
        if isinstance(mine, str) or isinstance(theirs, str):
            if mine != theirs:
                return name
        elif abs(mine - theirs) > next((bound for unit, bound in TOLERANCES.items() if name.endswith(unit)), 0.0):
            return name
    return ""
