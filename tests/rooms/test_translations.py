"""Every message is said in every language: nothing missing, nothing stale, holes kept, one translation per term."""

import re

import pytest

from app.languages import ENGLISH, LOCALES
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
OTHERS = [locale for tag, locale in LOCALES.items() if tag != ENGLISH]


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
        and re.search(rf"\b{term}s?\b", re.sub(r"\{\w*\}", "", message), re.IGNORECASE)
        and said not in text
    ]
    assert wrong == []


def test_a_missing_a_stale_and_a_broken_message_are_found() -> None:
    whole = dict.fromkeys(translations.said(), "x")
    holed = {one: "".join(f"{{{name}}}" for name in translations.HOLE.findall(one)) or "x" for one in whole}
    assert translations.wrong(holed) == []
    first, *_, last = sorted(holed)
    assert [one.split(":")[0] for one in translations.wrong({**holed, last: ""})] == ["missing"]
    assert [one.split(":")[0] for one in translations.wrong({**holed, "nobody says this": "y"})] == ["stale"]
    assert [one.split(":")[0] for one in translations.wrong({**holed, first: "{lost}"})] == ["holes differ"]
    assert [one.split(":")[0] for one in translations.wrong({**holed, last: holed[last] + "<b>"})] == ["markup"]
