"""Cuts a goal text into tokens with their places: words, single Chinese characters, separators and signs. Pure."""

import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

TokenKind = Literal["word", "separator", "quote", "control", "sign", "subject"]
_WORD = re.compile(r"[^\W_]+(?:['’][^\W\d_]+)?|_+")
_HAN = re.compile(r"[㐀-䶿一-鿿豈-﫿]")
SEPARATORS = {",": ",", "，": ",", "、": ",", ".": ".", "。": ".", "!": ".", "！": ".", "?": ".", "？": ".", "\n": "."}
SEPARATORS |= {";": ";", "；": ";", ":": ",", "：": ",", "…": "."}
QUOTES = {'"': '"', "“": "”", "”": "”", "„": "“", "«": "»", "「": "」", "『": "』", "‘": "’", "《": "》"}
"""Opening quotation marks and what closes them."""
_LINKING = "-_"


@dataclass(frozen=True)
class TextToken:
    """`text` is folded: lower case, plain apostrophes; `written` keeps the case. Places count characters."""

    kind: TokenKind
    text: str
    written: str
    start: int
    end: int


def tokens(text: str) -> tuple[TextToken, ...]:
    """Every character of the text except spaces, and except hyphens and underscores that join words."""
    return tuple(_tokens(text))


def folded(words: str) -> tuple[str, ...]:
    """A name or phrase as the words of its tokens."""
    return tuple(token.text for token in tokens(words))


def _tokens(text: str) -> Iterator[TextToken]:
    at = 0
    while at < len(text):
        char = text[at]
        if char in SEPARATORS:
            yield TextToken("separator", SEPARATORS[char], char, at, at + 1)
        elif char in QUOTES or char in QUOTES.values():
            yield TextToken("quote", char, char, at, at + 1)
        elif char.isspace() and char in " \t\r\u3000\u00a0":
            pass
        elif unicodedata.category(char) in ("Cc", "Cf", "Co", "Cn", "Zl", "Zp"):
            yield TextToken("control", char, char, at, at + 1)
        elif _HAN.match(char):
            yield TextToken("word", char, char, at, at + 1)
        elif word := _latin(text, at):
            yield TextToken("word", word.casefold().replace("’", "'"), word, at, at + len(word))
            at += len(word) - 1
        elif not (char in _LINKING and _joins(text, at)):
            yield TextToken("sign", char, char, at, at + 1)
        at += 1


def _latin(text: str, at: int) -> str:
    """The word that begins here, up to the next Chinese character."""
    found = _WORD.match(text, at)
    if found is None or found.group().startswith("_"):
        return ""
    word = found.group()
    han = _HAN.search(word)
    return word[: han.start()] if han else word


def _joins(text: str, at: int) -> bool:
    return 0 < at < len(text) - 1 and text[at - 1].isalnum() and text[at + 1].isalnum()
