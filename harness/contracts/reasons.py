"""Why something is as it is: a code and typed facts. Only the edge makes a sentence of it, in the reader's language."""

import msgspec

from harness.contracts.values import Name, Value

RECORDED = "recorded"
"""The code of a sentence that an older release stored as English text: its one fact is `text`."""


class Reason(Value):
    """`code` names one sentence of the catalogue; `facts` fill its holes, units in their names.

    A fact may be a reason itself, or several of them. Two reasons are equal if code and facts are.
    """

    code: Name
    facts: dict[str, "Fact"] = msgspec.field(default_factory=dict)


Fact = str | int | float | bool | Reason | tuple[Reason | str, ...] | None


def because(code: str, /, **facts: Fact) -> Reason:
    """`because("too_far_from_target", distance_m=7.49, bound_m=0.4)`."""
    return Reason(code=code, facts=facts)


def plain(reason: Reason) -> str:
    """`code (name value, name value)`: a reason where nobody's language is known, in logs and in exceptions."""
    if reason.code == RECORDED:
        return str(reason.facts["text"])
    facts = ", ".join(f"{name} {_plain(value)}" for name, value in reason.facts.items())
    return f"{reason.code} ({facts})" if facts else reason.code


def _plain(value: Fact) -> str:
    match value:
        case Reason():
            return plain(value)
        case tuple():
            return ", ".join(_plain(one) for one in value)
        case _:
            return str(value)


def recorded(text: str) -> Reason:
    """A sentence as an older release stored it; it stays as it was said."""
    return because(RECORDED, text=text)
