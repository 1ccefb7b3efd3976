"""Every message is said in every language: nothing missing, nothing stale, holes kept, one translation per term."""

import ast
import re
from itertools import product

import pytest

from app.catalogues import CONSOLE, ENGLISH, LOCALES, MACHINE
from app.settings import ROOT
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
OTHERS = list(product((locale for tag, locale in LOCALES.items() if tag != ENGLISH), (CONSOLE, MACHINE)))
APART = ("raise", "said", "lower", "address")
"""Where a text with words and holes is no sentence that is glued together for a reader."""
WRITTEN = ("provenance",)
"""What goes into the log as it is, in English."""


@pytest.mark.parametrize(("locale", "domain"), OTHERS)
def test_no_message_is_missing_stale_or_broken(locale: str, domain: str) -> None:
    assert translations.wrong(translations.read(locale, domain), domain) == []


@pytest.mark.parametrize(("locale", "domain"), OTHERS)
def test_the_catalogue_is_as_the_tool_writes_it(locale: str, domain: str) -> None:
    catalogue = translations.read(locale, domain)
    assert translations.mended(catalogue, domain) == catalogue


@pytest.mark.parametrize(("locale", "domain"), OTHERS)
def test_a_term_of_the_paper_has_one_translation(locale: str, domain: str) -> None:
    wrong = [
        (message, text)
        for message, text in translations.read(locale, domain).items()
        for term, said in GLOSSARY[locale].items()
        if text
        and message not in ELSEWHERE
        and re.search(rf"\b{term}s?\b", re.sub(r"\{[^{}]*\}", "", message), re.IGNORECASE)
        and said not in text
    ]
    assert wrong == []


def glued(source: str) -> list[int]:
    """Lines where words and holes become a text that no catalogue can know: not handed to `said`."""
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
    """The text of a part that a person would read: no address, no markup."""
    text = str(part.value) if isinstance(part, ast.Constant) else ""
    return "" if re.search(r"[/=&#<]", text) else text


def test_no_view_glues_words_and_values_to_a_sentence_that_cannot_be_told_in_another_language() -> None:
    views = sorted((ROOT / "app" / "views").glob("*.py"))
    assert {path.name: lines for path in views if (lines := glued(path.read_text(encoding="utf-8")))} == {}
    assert glued('text = f"{who} asked about {what} today"\n') == [1]


def test_a_missing_a_stale_and_a_broken_message_are_found() -> None:
    whole = dict.fromkeys(translations.said(), "x")
    holed = {one: "".join(f"{{{name}}}" for name in translations.HOLE.findall(one)) or "x" for one in whole}
    assert translations.wrong(holed) == []
    first, *_, last = sorted(holed)
    assert [one.split(":")[0] for one in translations.wrong({**holed, last: ""})] == ["missing"]
    assert [one.split(":")[0] for one in translations.wrong({**holed, "nobody says this": "y"})] == ["stale"]
    assert [one.split(":")[0] for one in translations.wrong({**holed, first: "{lost}"})] == ["holes differ"]
    assert [one.split(":")[0] for one in translations.wrong({**holed, last: holed[last] + "<b>"})] == ["markup"]
