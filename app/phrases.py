"""Pure: which words of a template persons read, and the template with those words in another language.

Nothing is marked in the templates: every run of text between two tags is a message, as is every text of an attribute
that is shown or read aloud. Expressions inside a message are its holes, numbered from 1.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

Translate = Callable[[str], str]
SHOWN = ("title", "aria-label", "placeholder", "alt", "label")
"""Attributes whose text reaches a person."""
VERBATIM = ("script", "style", "pre", "code", "kbd", "textarea")
"""Elements whose content is never translated: programs, what was typed, what is to be typed."""

_JINJA = re.compile(r"\{#.*?#\}|\{%.*?%\}|\{\{.*?\}\}", re.DOTALL)
_TAG = re.compile(r"<!--.*?-->|<!?/?[a-zA-Z][^<>]*>", re.DOTALL)
_NAME = re.compile(r"<(/?)([a-zA-Z][\w-]*)")
_ATTRIBUTE = re.compile(rf'(?<=\s)({"|".join(SHOWN)})="([^"]*)"', re.DOTALL)
_EDGES = re.compile(r"(\s*)(.*?)(\s*)\Z", re.DOTALL)
_EXPRESSION, _STATEMENT = re.compile("[\ue000-\uefff]"), re.compile("([\uf000-\uf8ff])")
_PLAIN = re.compile("[\ue000-\uefff]|&#?\\w+;")
_LETTER = re.compile(r"[A-Za-z]{2}")
_CONSTANT = re.compile(r'(?:^|else|\bor|\()\s*"([^"]+)"\s*(?=if|else|$|\))')
_TOLD = re.compile(r"\{\{ \((.*?)\) \| told \}\}", re.DOTALL)
_QUOTED = re.compile(r'"([^"]+)"')
_SCRIPT = re.compile(r'\btr\("((?:[^"\\]|\\.)*)"')


@dataclass(frozen=True)
class _Masked:
    """A template whose Jinja parts are one sign each, so that only markup and text are left to read."""

    text: str
    parts: tuple[str, ...]

    def whole(self, text: str) -> str:
        """With the parts back in their places, as they were."""
        return re.sub("[\ue000-\uf8ff]", lambda sign: self.parts[ord(sign[0]) & 0xFFF], text)

    def expression(self, sign: str) -> str:
        """One expression, its value said in the reader's language where it is known."""
        inner = self.parts[ord(sign) & 0xFFF][2:-2].strip("-+ \n")
        return f"{{{{ ({inner}) | told }}}}"


def messages(source: str) -> Iterator[str]:
    """Every message of a template, in order, repeated where it is repeated."""
    found: list[str] = []

    def note(message: str) -> str:
        found.append(message)
        return message

    said = spoken(source, note)
    yield from found
    for part in _TOLD.findall(said):
        yield from (one for one in _CONSTANT.findall(part) if _LETTER.search(one))


def quoted(source: str) -> Iterator[str]:
    """Every text constant in a template's statements and expressions: some of them reach a person."""
    for part in _JINJA.findall(source):
        yield from _QUOTED.findall(part)


def script_messages(source: str) -> Iterator[str]:
    """Every message that a script says: the literal it hands to `tr`."""
    yield from _SCRIPT.findall(source)


def spoken(source: str, translate: Translate) -> str:
    """The same template with every message translated. Statements, addresses and identifiers stay as they are."""
    masked = _mask(source)
    out: list[str] = []
    end, verbatim = 0, ""
    for tag in _TAG.finditer(masked.text):
        out.append(_text(masked, masked.text[end : tag.start()], None if verbatim else translate))
        end = tag.end()
        out.append(_tag(masked, tag.group(), translate))
        verbatim = _inside(tag.group(), verbatim)
    out.append(_text(masked, masked.text[end:], translate))
    return "".join(out)


def _mask(source: str) -> _Masked:
    parts: list[str] = []

    def hide(match: re.Match[str]) -> str:
        parts.append(match.group())
        base = 0xE000 if match.group().startswith("{{") else 0xF000
        return chr(base + len(parts) - 1)

    text = _JINJA.sub(hide, source)
    return _Masked(text=text, parts=tuple(parts))


def _inside(tag: str, verbatim: str) -> str:
    """The verbatim element that the text after this tag stands in; an option without a value sends its text."""
    named = _NAME.match(tag)
    if named is None:
        return verbatim
    closing, name = named.group(1), named.group(2).lower()
    if verbatim:
        return "" if closing and name == verbatim else verbatim
    sends_text = name == "option" and "value=" not in tag
    return name if not closing and (name in VERBATIM or sends_text) else ""


def _tag(masked: _Masked, tag: str, translate: Translate) -> str:
    out, end = [], 0
    for attribute in _ATTRIBUTE.finditer(tag):
        out.append(masked.whole(tag[end : attribute.start(2)]))
        out.append(_text(masked, attribute.group(2), translate))
        end = attribute.end(2)
    return "".join(out) + masked.whole(tag[end:])


def _text(masked: _Masked, text: str, translate: Translate | None) -> str:
    if translate is None:
        return masked.whole(text)
    return "".join(
        masked.whole(run) if _STATEMENT.fullmatch(run) else _run(masked, run, translate)
        for run in _STATEMENT.split(text)
    )


def _run(masked: _Masked, run: str, translate: Translate) -> str:
    edges = _EDGES.match(run)
    assert edges is not None
    before, core, after = edges.groups()
    holes = _EXPRESSION.findall(core)
    if '="' in core:
        return masked.whole(run)
    if not _LETTER.search(_PLAIN.sub("", core)):
        return before + _EXPRESSION.sub(lambda sign: masked.expression(sign.group()), core) + after
    number = {sign: str(place) for place, sign in enumerate(holes, 1)}
    message = _EXPRESSION.sub(lambda sign: f"{{{number[sign.group()]}}}", " ".join(core.split()))
    said = re.sub(r"\{(\d+)\}", lambda hole: masked.expression(holes[int(hole.group(1)) - 1]), translate(message))
    return before + said + after
