"""Pure: what the machinery said, told again in a reader's language. What is stored stays as it was said, in English.

A sentence is known by its message, an English text with named holes. What fills a hole is told in its turn.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import get_args

from harness.contracts.configuration import FailureClass, RecoveryAction
from harness.contracts.verdicts import Verdict

LONGEST, KEPT = 2000, 8192
CLOSED: Mapping[str, tuple[str, ...]] = {
    "verdict": get_args(Verdict), "failure": get_args(FailureClass), "action": get_args(RecoveryAction),
}  # fmt: skip
"""Holes that only these words fill."""
OPEN = frozenset({"reason", "why", "said", "error", "bounds", "either", "join", "message", "begun"})
"""Holes that whole sentences fill."""
BEGINNING = "{upper}{"
"""Before a hole whose text begins with a capital because it begins the sentence."""
_HOLE = re.compile(r"\{(\w+)\}")
_SENTENCES = re.compile(r"(?<=\.) (?=[A-Za-z“])")
_REST = r"(?:(?!; |\. |: )[^()])*?"


@dataclass(frozen=True)
class _Sentence:
    """`sign` stands in every text that was made of the message: looking for it is cheap."""

    sign: str
    sure: bool
    pattern: re.Pattern[str]
    translation: str


class Retelling:
    """`words` are told where they stand alone; `sentences` also with their holes filled."""

    def __init__(self, words: Mapping[str, str], sentences: Mapping[str, str]) -> None:
        self._whole = {**sentences, **words}
        made = [_sentence(message, text) for message, text in sentences.items() if _HOLE.search(message)]
        self._sentences = sorted(made, key=lambda one: (one.sure, len(one.sign)), reverse=True)
        self.told = lru_cache(KEPT)(self._told)

    def _told(self, text: str) -> str:
        """The text in the reader's language as far as it is known, else as it is."""
        whole = self._whole.get(text)
        if whole is not None or " " not in text or len(text) > LONGEST:
            return whole or text
        return self._matched(text) or self._matched(f"{text}.").removesuffix("。") or self._parts(text)

    def _matched(self, text: str) -> str:
        """The text as one sentence with its holes filled; empty if it is none."""
        for one in self._sentences:
            found = one.pattern.fullmatch(text) if one.sign in text else None
            if found is not None:
                filled = {name: self._filling(name, said) for name, said in found.groupdict().items()}
                return one.translation.format(**filled)
        return ""

    def _filling(self, name: str, said: str) -> str:
        if name == "begun":
            return self.told(f"{said[:1].lower()}{said[1:]}")
        return self._word(said) or self.told(said)

    def _word(self, said: str) -> str:
        """A word, or a slug as words; empty for what is neither."""
        return self._whole.get(said) or self._whole.get(said.replace("_", " "), "")

    def _parts(self, text: str) -> str:
        """Sentences or reasons, told if all of them are known; whose a reason is; a list of words."""
        for parts, between in ((_SENTENCES.split(text), ""), (text.split("; "), "；")):
            if len(parts) > 1:
                told = [self.told(one) for one in parts]
                return text if any(one == part for one, part in zip(told, parts, strict=True)) else between.join(told)
        if text.endswith(".") and self.told(text[:-1]) != text[:-1]:
            return f"{self.told(text[:-1])}。"
        whose, _, reason = text.partition(": ")
        why = self._word(reason) or self.told(reason)
        if reason and why != reason and (self.told(whose) != whose or " " not in whose):
            return f"{self._word(whose) or self.told(whose)}：{why}"
        for separator, between in ((", ", "、"), (" or ", "或")):
            listed = [self._word(one) for one in text.split(separator)]
            if len(listed) > 1 and all(listed):
                return between.join(listed)
        return text


def _sentence(message: str, translation: str) -> _Sentence:
    begun = BEGINNING in message
    if begun:
        name = _HOLE.findall(message)[1]
        message = message.replace(f"{BEGINNING}{name}}}", "{begun}")
        translation = translation.replace(f"{BEGINNING}{name}}}", "{begun}")
    names = _HOLE.findall(message)
    literals = _HOLE.split(message)[::2]
    pattern = "".join(
        _hole(part) if part in {f"{{{name}}}" for name in names} else re.escape(part)
        for part in re.split(r"(\{\w+\})", message)
    )
    sure = any(_kind(name) in CLOSED for name in names)
    return _Sentence(sign=max(literals, key=len), sure=sure, pattern=re.compile(pattern), translation=translation)


def _hole(part: str) -> str:
    name = part[1:-1]
    kind = _kind(name)
    if kind in CLOSED:
        filling = "|".join(one.replace("_", "[ _]") for one in CLOSED[kind])
    else:
        filling = ".*?" if kind in OPEN else _REST
    return f"(?P<{name}>{filling})"


def _kind(name: str) -> str:
    """A second hole of the same name is of the same kind."""
    return re.sub(r"_\d+\Z", "", name)
