"""Checks that every message is translated into every language: none missing or stale, holes kept, one translation per
term.
"""

import ast
import re

import pytest

from app.i18n.catalogues import ENGLISH, LOCALES
from app.settings import ROOT
from tests.architecture.markup import template_texts
from tools import translations

GLOSSARY = {
    "zh_Hans_CN": {
        "mission": "任务", "handoff": "交接", "evidence": "证据", "verdict": "裁定", "provider": "提供方",
        "receipt": "回执", "alert": "告警", "robot": "机器人", "gate": "闸门", "contract": "契约", "stage": "阶段",
        "recovery budget": "恢复预算", "hardware stop": "硬件急停", "state version": "状态版本", "candidate": "候选",
        "configuration": "配置", "trajectory": "轨迹",
    },
}  # fmt: skip
"""A term of the paper has one translation, wherever it stands."""
ELSEWHERE = {"tablet at the gate", "stage, reason, person, whole id"}
"""A gate of a building; a word that the placeholder's own list translates."""
TYPED = re.compile(r"`[^`]*`")
"""A command as it is typed, the same in every language."""
OTHERS = [locale for tag, locale in LOCALES.items() if tag != ENGLISH]
APART = ("raise", "lazy_gettext", "lower", "address")
"""Where a text with words and holes is no sentence that is glued together for a reader."""
WRITTEN = ("provenance",)
"""What goes into the log as it is, in English."""


@pytest.mark.parametrize("locale", OTHERS)
def test_no_message_is_missing_stale_or_broken(locale: str) -> None:
    assert translations.wrong(translations.read(locale)) == []


@pytest.mark.parametrize("locale", OTHERS)
def test_the_catalogue_is_as_the_tool_writes_it(locale: str) -> None:
    catalogue = translations.read(locale)
    assert translations.mended(catalogue) == catalogue


@pytest.mark.parametrize("locale", OTHERS)
def test_a_term_of_the_paper_has_one_translation(locale: str) -> None:
    wrong = [
        (message, text)
        for message, text in translations.read(locale).items()
        for term, said in GLOSSARY[locale].items()
        if text
        and message not in ELSEWHERE
        and re.search(rf"\b{term}s?\b", TYPED.sub("", translations.HOLE.sub("", message)), re.IGNORECASE)
        and said not in text
    ]
    assert wrong == []


def glued(source: str) -> list[int]:
    """Lines where words and holes are joined to a text that no catalogue has: not passed to `lazy_gettext`."""
    tree = ast.parse(source)
    fine: set[int] = set()
    for node in ast.walk(tree):
        name = getattr(getattr(node, "func", None), "attr", getattr(getattr(node, "func", None), "id", ""))
        written = isinstance(node, ast.keyword) and node.arg in WRITTEN
        if isinstance(node, ast.Raise) or name in APART or written:
            fine |= {id(part) for part in ast.walk(node)}
    return [
        node.lineno
        for node in ast.walk(tree)
        if isinstance(node, ast.JoinedStr)
        and id(node) not in fine
        and len(re.findall(r"[A-Za-z]{2,}", " ".join(_words(part) for part in node.values))) > 1
    ]


def _words(part: ast.expr) -> str:
    """The text of a part that a person reads: no address, no markup."""
    text = str(part.value) if isinstance(part, ast.Constant) else ""
    return "" if re.search(r"[/=&#<]", text) else text


VERBATIM = re.compile(r"<(script|style|pre|code|kbd|textarea)\b.*?</\1>|<option>.*?</option>", re.DOTALL)
"""What is never translated: programs, what was typed, what is to be typed."""
MARKED = re.compile(r"\{%-?\s*trans\b.*?endtrans\s*-?%\}", re.DOTALL)
SHOWN = re.compile(r"""\s(?:title|aria-label|placeholder|alt|label)\s*=\s*("[^"]*"|'[^']*')""")
"""Attributes whose text reaches a person."""
NAMES = {"RegenHarness", "HandoffApproved", "JSON", "PDF", "alpha", "sha256", "sign_in"}
"""Names and slugs, the same in every language."""
READ = re.compile(r"[A-Za-z“](?:[^{}<>/_\\=$:\n]|:(?=\s|\Z))*")
"""Something to read: words with a space between them, and no code."""
INTERNAL = {"a canary has a manifest"}
"""What only a programming error shows."""


def unmarked(source: str) -> list[str]:
    """Words of a template that a person reads and no catalogue has."""
    bare = re.sub(r"\{\{.*?\}\}|\{%.*?%\}|\{#.*?#\}", "", MARKED.sub("", source), flags=re.DOTALL)
    attributes = [value for tag in re.findall(r"<[a-zA-Z][^<>]*>", bare) for value in SHOWN.findall(tag)]
    texts = re.split(r"<!--.*?-->|<!?/?[a-zA-Z][^<>]*>", VERBATIM.sub("", bare), flags=re.DOTALL)
    words = [re.sub(r"&#?\w+;", "", text).strip(" \"'·\n") for text in (*texts, *attributes)]
    return [text for text in words if re.search(r"[A-Za-z]{2}", text) and '="' not in text and text not in NAMES]


def unmarked_constants(source: str) -> list[str]:
    """Sentences in a view that are neither passed to `lazy_gettext` nor marked with `N_`."""
    tree = ast.parse(source)
    fine = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in ast.walk(node)}
    fine |= {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("lazy_gettext", "N_"):
            fine |= {id(argument) for argument in node.args}
    texts = [node for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    return [str(one.value) for one in texts if id(one) not in fine and _to_read(str(one.value))]


def _to_read(text: str) -> bool:
    inside = " " in text and text == text.strip() and text not in INTERNAL
    return inside and bool(READ.fullmatch(text)) and not re.search(r"-src\b|^live:", text)


def test_every_word_of_a_template_is_marked_for_translation() -> None:
    wrong = {name: words for name, text in template_texts().items() if (words := unmarked(text))}
    assert wrong == {}


def test_every_sentence_of_a_view_is_marked_for_translation() -> None:
    views = sorted((ROOT / "app" / "views").glob("*.py"))
    wrong = {path.name: texts for path in views if (texts := unmarked_constants(path.read_text(encoding="utf-8")))}
    assert wrong == {}


def test_a_word_that_nobody_marked_is_found() -> None:
    assert unmarked('<p title="Read me">{{ _("fine") }} {% trans %}fine{% endtrans %} not fine</p>') == [
        "not fine", "Read me",
    ]  # fmt: skip
    assert unmarked("<code>regen up</code><option>vbot-1</option> {{ name }} · RegenHarness") == []
    assert unmarked_constants('"""Doc here."""\nx = N_("fine so")\ny = ("not fine", lazy_gettext("fine too"))') == [
        "not fine"
    ]


def test_no_view_glues_words_and_values_to_a_sentence_that_cannot_be_told_in_another_language() -> None:
    views = sorted((ROOT / "app" / "views").glob("*.py"))
    assert {path.name: lines for path in views if (lines := glued(path.read_text(encoding="utf-8")))} == {}
    assert glued('text = f"{who} asked about {what} today"\n') == [1]


def test_a_missing_a_stale_and_a_broken_message_are_found() -> None:
    whole = dict.fromkeys(translations.catalogue_texts(), "x")
    holed = {one: "".join(translations.HOLE.findall(one)) or "x" for one in whole}
    assert translations.wrong(holed) == []
    first, *_, last = sorted(holed)
    assert [one.split(":")[0] for one in translations.wrong({**holed, last: ""})] == ["missing"]
    assert [one.split(":")[0] for one in translations.wrong({**holed, "nobody says this": "y"})] == ["stale"]
    assert [one.split(":")[0] for one in translations.wrong({**holed, first: "{lost}"})] == ["holes differ"]
    assert [one.split(":")[0] for one in translations.wrong({**holed, last: holed[last] + "<b>"})] == ["markup"]
