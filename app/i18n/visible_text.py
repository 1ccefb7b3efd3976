"""Finds characters that no reader sees, or that move what they see, and makes them visible: on pages, paper, terminals.

Control characters steer a terminal, bidirectional overrides turn text around, zero-width characters and tags hide it.
Line breaks and tabs stay; so do the joiners that scripts need.
"""

import re
from collections.abc import Mapping
from typing import Any

UNSEEN = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u00ad\u061c\u180e\u200b\u200e\u200f\u2028-\u202e\u2060-\u2069\ufeff\ufff9-\ufffb"
    "\ud800-\udfff\U000e0000-\U000e007f]"
)
"""Whatever may not stand in a text that is shown."""
OVERWRITES = re.compile(r"\r(?!\n)")
"""A lone carriage return: at a terminal, what follows covers what was there."""
PICTURES = 0x2400
"""Where Unicode has a picture of each control character of ASCII."""


def unseen_in(value: Any) -> str:
    """The first character that may not be shown, as U+XXXX; empty without one. Looks into lists and mappings."""
    match value:
        case str():
            found = UNSEEN.search(value)
            return f"U+{ord(found[0]):04X}" if found else ""
        case Mapping():
            return next(filter(None, (unseen_in(one) for pair in value.items() for one in pair)), "")
        case list() | tuple():
            return next(filter(None, (unseen_in(one) for one in value)), "")
        case _:
            return ""


def visible(text: str) -> str:
    """The text with a sign or a code for each character that nobody would see."""
    return UNSEEN.sub(_replacement, text)


def visible_at_terminal(text: str) -> str:
    """The same for a terminal, where a lone carriage return would cover what stands before it."""
    return visible(OVERWRITES.sub("\u240d", text))


def escaped(json_text: str) -> str:
    """JSON of the same value in which such a character is written as its escape."""
    return UNSEEN.sub(_escape, json_text)


def _replacement(found: re.Match[str]) -> str:
    code = ord(found[0])
    if code < 0x20:
        return chr(PICTURES + code)
    return "\u2421" if code == 0x7F else f"\u27e8U+{code:04X}\u27e9"


def _escape(found: re.Match[str]) -> str:
    code = ord(found[0])
    if code < 0x10000:
        return f"\\u{code:04x}"
    high, low = divmod(code - 0x10000, 0x400)
    return f"\\u{0xD800 + high:04x}\\u{0xDC00 + low:04x}"
