"""Turns a reason, which is a code with facts, into a sentence in the reader's language; nothing else does.

A message has named holes with Python's format specifications, and a few of our own: `{x:word}` is a term of the
vocabulary, `{x:words}` several of them, `{x:or}` the same with "or" before the last, `{x:capital}` begins a sentence,
`{x:instant}` is an instant with its date and `{x:clock}` its time of day.
"""

import re
import warnings
from collections.abc import Mapping
from datetime import UTC, datetime
from string import Formatter
from typing import Any

from babel.dates import format_datetime
from msgspec import UNSET, Struct, structs, to_builtins

from app.i18n.catalogues import ENGLISH, LOCALES, N_, translated
from app.i18n.reasons import (
    access,
    alerts,
    audits,
    candidates,
    compiling,
    conformance,
    console,
    contexts,
    contracts,
    evaluations,
    execution,
    gate,
    goals,
    locations,
    models,
    outcomes,
    planning,
    proposals,
    providers,
    recordings,
    recovery,
    reports,
    requests,
    restrictions,
    reviews,
    robot_programs,
    robots,
    routing,
    sites,
    stores,
    supervision,
    verification,
    vocabulary,
)
from harness.contracts.errors import HarnessError
from harness.contracts.reasons import RECORDED, SEVERAL, Explanation, Reason, because, plain

SENTENCES: Mapping[str, str] = {
    RECORDED: "{text}",
    SEVERAL: "{reasons}",
    **access.SENTENCES,
    **alerts.SENTENCES,
    **audits.SENTENCES,
    **candidates.SENTENCES,
    **compiling.SENTENCES,
    **conformance.SENTENCES,
    **console.SENTENCES,
    **contexts.SENTENCES,
    **contracts.SENTENCES,
    **evaluations.SENTENCES,
    **execution.SENTENCES,
    **gate.SENTENCES,
    **goals.SENTENCES,
    **locations.SENTENCES,
    **models.SENTENCES,
    **outcomes.SENTENCES,
    **planning.SENTENCES,
    **proposals.SENTENCES,
    **providers.SENTENCES,
    **recordings.SENTENCES,
    **recovery.SENTENCES,
    **restrictions.SENTENCES,
    **reviews.SENTENCES,
    **reports.SENTENCES,
    **requests.SENTENCES,
    **robot_programs.SENTENCES,
    **robots.SENTENCES,
    **routing.SENTENCES,
    **sites.SENTENCES,
    **stores.SENTENCES,
    **supervision.SENTENCES,
    **verification.SENTENCES,
    **vocabulary.SENTENCES,
}
"""Every code of the project and its message."""
REMEDIES: Mapping[str, str] = {
    **access.REMEDIES,
    **candidates.REMEDIES,
    **vocabulary.REMEDIES,
    **compiling.REMEDIES,
    **contracts.REMEDIES,
    **evaluations.REMEDIES,
    **models.REMEDIES,
    **providers.REMEDIES,
    **recordings.REMEDIES,
    **requests.REMEDIES,
    **robot_programs.REMEDIES,
    **robots.REMEDIES,
    **sites.REMEDIES,
    **stores.REMEDIES,
}
"""What to do about an error, by the code of what happened."""
VARIANTS: Mapping[str, tuple[str, Any, str]] = {
    "all_conditions_hold": ("count", 1, N_("The condition holds.")),
    "handoff_was_answered": ("decision", "expired", N_("The handoff expired unanswered")),
    "retreat_ended": ("outcome", "short", N_("Return failed: {reason}; the provider declared {declared:word}")),
    "retreat_over": ("outcome", "short", N_("the return to the safe point failed")),
}
"""Codes with a second message, for one value of one fact: the fact, the value, the message."""
BETWEEN: Mapping[str, tuple[str, str, str]] = {"en": (", ", "; ", " or "), "zh-Hans": ("、", "；", "或")}
"""What stands between names, between sentences, and before the last of several that are offered."""
ENDS: Mapping[str, str] = {"en": ". ", "zh-Hans": "。"}
"""What ends a sentence before the next."""
EXPLAINING = frozenset({"failure_explained", "given_up_for_good"})
"""Codes that name a failure and then say why."""
WHERE = N_("Where: {where}")
INSTANTS: Mapping[str, str] = {"instant": "yyyy-MM-dd HH:mm:ss", "clock": "HH:mm:ss"}
"""How an instant, in seconds since the Unix epoch, is written: with its date, or by its time of day."""
NONE = "none"
"""The fact that stands for an empty list; every other name is a name, whatever the catalogue holds."""
WORDS = frozenset({"word", "words", "or", "capital"})
"""Format specifications that are ours."""
TWO_STOPS = re.compile(r"(?<!\.)\.\.(?=\s|$)|。。")
"""A reason that ends as a sentence, in a message that goes on after it with a stop of its own."""


def sentence(reason: Explanation, language: str = ENGLISH) -> str:
    """The reason in that language; text stays as it is. A code without a sentence warns and is shown with its facts."""
    if isinstance(reason, str):
        return reason
    message = _message(reason)
    if message is None:
        warnings.warn(f"the reason {reason.code!r} has no sentence", stacklevel=2)
        return plain(reason)
    try:
        text = _Formatter(language).vformat(translated(message, language), (), _facts(reason)).strip()
    except (KeyError, ValueError, TypeError) as wrong:
        warnings.warn(f"the facts of {reason!r} do not fill its sentence: {wrong!r}", stacklevel=2)
        return plain(reason)
    return TWO_STOPS.sub(lambda found: found[0][0], text)


def beside(failure: str, reason: Explanation) -> Explanation:
    """The reason where its failure is named beside it: that word is not said a second time."""
    if (
        isinstance(reason, Reason)
        and reason.code == "execution_over_with_failure"
        and reason.facts["failure"] == failure
    ):
        return because("execution_over", terminal=reason.facts["terminal"])
    return reason


def _facts(reason: Reason) -> Mapping[str, Any]:
    failure = reason.facts.get("failure")
    if reason.code not in EXPLAINING or not isinstance(failure, str):
        return reason.facts
    return {name: beside(failure, one) if isinstance(one, Reason) else one for name, one in reason.facts.items()}


def _message(reason: Reason) -> str | None:
    fact, value, variant = VARIANTS.get(reason.code, ("", None, ""))
    return variant if fact and reason.facts.get(fact) == value else SENTENCES.get(reason.code)


def remedy(error: HarnessError, language: str = ENGLISH) -> str:
    """What to do about an error: what it says itself, else what follows from its code; empty where nothing does."""
    if error.do or isinstance(error.what, str):
        return sentence(error.do, language)
    message = translated(REMEDIES.get(error.what.code, ""), language)
    return _Formatter(language).vformat(message, (), error.what.facts)


def explained(error: HarnessError, language: str = ENGLISH) -> str:
    """An error in one line: what happened, where, and what to do."""
    where = translated(WHERE, language).format(where=sentence(error.where, language)) if error.where else ""
    parts = (sentence(error.what, language), where, remedy(error, language))
    end = ENDS[language]
    return end.join(part.rstrip(".。") for part in parts if part) + end.rstrip()


def sentences(reasons: tuple[Explanation, ...], language: str = ENGLISH) -> str:
    """Several reasons one after the other, as the language separates them."""
    return BETWEEN[language][1].join(sentence(one, language) for one in reasons)


def stated(name: str, reason: Explanation) -> dict[str, Any]:
    """A reason for programs: its English sentence under `name`, its code and facts beside it; text has no code."""
    facts = reason.facts if isinstance(reason, Reason) else {}
    code = reason.code if isinstance(reason, Reason) else ""
    return {name: sentence(reason), f"{name}_code": code, f"{name}_facts": to_builtins(facts)}


def stating(value: Any) -> Any:
    """A value as JSON holds it, every reason in it as `stated` does it; a field that is unset is left out."""
    match value:
        case Reason():
            return sentence(value)
        case Struct():
            fields = {field.encode_name: getattr(value, field.name) for field in structs.fields(value)}
            known = {name: one for name, one in fields.items() if one is not UNSET}
            return stating(known | _tag(value))
        case dict():
            found: dict[str, Any] = {}
            for name, one in value.items():
                found |= stated(str(name), one) if isinstance(one, Reason) else {str(name): stating(one)}
            return found
        case list() | tuple():
            return [stating(one) for one in value]
        case str():
            return str(value)
        case _:
            return to_builtins(value)


def _tag(value: Struct) -> dict[str, Any]:
    config = value.__struct_config__
    return {config.tag_field: config.tag} if config.tag_field else {}


def word(slug: str, language: str = ENGLISH) -> str:
    """A term of the vocabulary, as contracts spell it, in a language: awaiting_human is said as awaiting human."""
    return translated(slug.replace("_", " "), language)


class _Formatter(Formatter):
    """Fills the holes of one message with facts."""

    def __init__(self, language: str) -> None:
        self._language = language

    def format_field(self, value: Any, format_spec: str) -> str:
        """A fact as its hole asks for it."""
        commas, semicolons, alternatives = BETWEEN[self._language]
        match value:
            case Reason():
                text = sentence(value, self._language)
                return f"{text[:1].upper()}{text[1:]}" if format_spec == "capital" else text
            case tuple() if any(isinstance(one, Reason) for one in value):
                return semicolons.join(self.format_field(one, "") for one in value)
            case tuple():
                listed = [self.format_field(one, "word" if format_spec else "") for one in value]
                if format_spec == "or" and len(listed) > 1:
                    return alternatives.join((commas.join(listed[:-1]), listed[-1]))
                return commas.join(listed)
            case str() if format_spec == "capital":
                text = word(value, self._language)
                return f"{text[:1].upper()}{text[1:]}"
            case int() | float() if format_spec in INSTANTS:
                at = datetime.fromtimestamp(value, UTC)
                return format_datetime(at, INSTANTS[format_spec], locale=LOCALES[self._language]) + " UTC"
            case str() if format_spec in WORDS:
                return word(value, self._language)
            case str() if value == NONE:
                return word(value, self._language)
            case _:
                return str(super().format_field(value, format_spec))
