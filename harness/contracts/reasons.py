"""Reasons as a code and typed facts; the app renders them as sentences in the reader's language."""

from collections.abc import Iterator, Sequence

import msgspec

from harness.contracts.values import Name, Value

RECORDED, SEVERAL = "recorded", "several"
"""The codes of a stored sentence, in its fact `text`; and of several reasons, in `reasons`."""


class Reason(Value):
    """`code` names one sentence of the catalogue; `facts` fill its holes, units in their names.

    A fact may be a reason itself, or several of them. Two reasons are equal if code and facts are.
    """

    code: Name
    facts: dict[str, "Fact"] = msgspec.field(default_factory=dict)


Explanation = Reason | str
"""A reason as the log holds it: one of the harness, or unchanged text of a person or an older release."""

Fact = str | int | float | bool | Reason | tuple[Reason | str, ...] | None


def because(code: str, /, **facts: Fact) -> Reason:
    """Build a reason: `because("too_far_from_target", distance_m=7.49, bound_m=0.4)`."""
    return Reason(code=code, facts=facts)


UNEXPLAINED = because("stopped_at_console")
"""The reason of a stop that was pressed at once; why may be said while it is carried out."""


def several(reasons: Sequence[Explanation]) -> Reason | None:
    """Join reasons into one, in order; a single reason is returned unchanged, no reason gives None."""
    if len(reasons) == 1 and isinstance(reasons[0], Reason):
        return reasons[0]
    return because(SEVERAL, reasons=tuple(reasons)) if reasons else None


def parts(reason: Explanation) -> Iterator[Reason]:
    """The reason and every reason within it."""
    if isinstance(reason, Reason):
        yield reason
        for value in reason.facts.values():
            for one in value if isinstance(value, tuple) else (value,):
                yield from parts(one) if isinstance(one, Reason) else ()


def plain(reason: Explanation) -> str:
    """`code (name value, name value)`: a reason without any language, for logs and exceptions."""
    if isinstance(reason, str):
        return reason
    facts = ", ".join(f"{name} {_plain(value)}" for name, value in sorted(reason.facts.items()))
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
    """A sentence as an older release stored it, shown unchanged."""
    return because(RECORDED, text=text)
