"""Which language a reader gets, which words of a template are said in it, and what is never touched."""

from datetime import UTC, datetime

import jinja2
import pytest
from starlette.datastructures import Headers

from app.catalogues import catalogue
from app.filters import duration, instant, named, words
from app.languages import preferred, told
from app.phrases import messages, spoken
from app.views.saying import Said, listed, said
from tests.builders.consoles import console_stand

ZH = "zh-Hans"


@pytest.mark.parametrize(
    ("headers", "language"),
    [
        ({}, "en"),
        ({"accept-language": "zh-CN,zh;q=0.9,en;q=0.5"}, ZH),
        ({"accept-language": "de-DE,de;q=0.9,en;q=0.5,zh;q=0.4"}, "en"),
        ({"accept-language": "fr"}, "en"),
        ({"accept-language": "zh;q=0, en"}, "en"),
        ({"accept-language": "zh;q=oops, ;,"}, "en"),
        ({"accept-language": "en", "cookie": "regen_language=zh-Hans"}, ZH),
        ({"accept-language": "zh", "cookie": "regen_language=en"}, "en"),
        ({"accept-language": "zh", "cookie": "regen_language=klingon"}, ZH),
    ],
)
def test_the_cookie_comes_first_then_what_the_browser_prefers(headers: dict[str, str], language: str) -> None:
    assert preferred(Headers(headers)) == language


def test_texts_and_shown_attributes_are_messages_and_nothing_else_is() -> None:
    source = """{# no #}<p id="x" class="soft" title="A title">Hello {{ name }}, you have {{ n }} rows</p>
    {% if "a" == b %}<b>or this</b>{% endif %}<code>regen up</code><option>vbot-1</option><option value="1">one</option>
    <input name="q" placeholder="search"> {{ "yes" if x == "state" else "no way" }} &middot; {{ name }}"""
    assert list(messages(source)) == [
        "A title", "Hello {1}, you have {2} rows", "or this", "one", "search", "yes", "no way",
    ]  # fmt: skip


def test_a_translated_template_keeps_its_logic_addresses_and_holes() -> None:
    source = '<a href="/open/{{ id }}" title="open {{ id }}">open{% if n %} {{ n }} of {{ m }} rows{% endif %}</a>'
    other = {"open": "打开", "open {1}": "打开 {1}", "{1} of {2} rows": "共 {2} 行之 {1}"}
    text = spoken(source, lambda message: other[message])
    jinja = jinja2.Environment(autoescape=True)
    jinja.filters["told"] = lambda value: value
    said_so = jinja.from_string(text).render(id="x<y", n=2, m=9)
    assert said_so == '<a href="/open/x&lt;y" title="打开 x&lt;y">打开 共 9 行之 2</a>'


def test_attributes_that_a_macro_writes_stay_as_they_are_in_every_language() -> None:
    macro = '{% macro live(part) %}id="{{ part }}" hx-get="/missions/{{ part }}"{% endmacro %}'
    assert spoken(macro, lambda message: "证据") == macro


def test_a_list_is_separated_as_its_language_does_and_a_name_is_no_word_of_it() -> None:
    assert told(listed(("operator", "admin", "ada")), ZH) == "操作员、管理员、ada"
    assert (listed(()), listed(("operator",)), listed(("a", "b"))) == ("", "operator", "a, b")
    assert told(named("operator"), ZH) == "operator"


def test_what_was_said_with_fields_is_said_again_in_the_readers_language() -> None:
    text = said("{actor} asked to stop: {reason}", actor="ada", reason="smoke")
    assert isinstance(text, str) and text == "ada asked to stop: smoke"
    assert told(text, ZH) == "ada 请求停止：smoke"
    assert told(text, "en") is text


def test_what_a_person_typed_is_never_a_template() -> None:
    text = said("{actor} asked to stop: {reason}", actor="{reason}", reason="{0.__class__}")
    assert told(text, ZH) == "{reason} 请求停止：{0.__class__}"
    assert words("{odd}_slug") == "{odd} slug"


def test_words_instants_and_durations_follow_the_language() -> None:
    at_s = datetime(2026, 11, 20, 9, 30, 5, tzinfo=UTC).timestamp()
    assert (instant(at_s), told(instant(at_s), ZH)) == ("2026-11-20 09:30:05 UTC", "2026年11月20日 09:30:05 UTC")
    assert (duration(161), told(duration(161), ZH)) == ("2 min 41 s", "2 分 41 秒")
    assert (words("awaiting_human"), told(words("awaiting_human"), ZH)) == ("awaiting human", "等待人回答")


def test_markup_numbers_and_unknown_words_stay_as_they_are() -> None:
    for value in (Said("nobody translated this {x}", {"x": 1}), "msn_00000001", 4, None):
        assert told(value, ZH) == value
    assert catalogue("en") == {}


def test_the_switch_works_without_scripts_is_kept_and_names_the_language() -> None:
    with console_stand() as stand:
        reader = stand.operator()
        first = reader.get("/missions?status=succeeded")
        assert first.headers["content-language"] == "en"
        assert 'href="?status=succeeded&amp;lang=zh-Hans"' in first.text
        switched = reader.get("/missions?status=succeeded&lang=zh-Hans")
        assert '<html lang="zh-Hans">' in switched.text and "<h1>任务</h1>" in switched.text
        assert (
            "regen_language=zh-Hans; Path=/; Max-Age=31536000; SameSite=Lax; HttpOnly" in switched.headers["set-cookie"]
        )
        assert "<h1>交接</h1>" in reader.get("/handoffs").text
        assert "<h1>Handoffs</h1>" in reader.get("/handoffs?lang=en").text
        assert "<h1>Handoffs</h1>" in reader.get("/handoffs?lang=nonsense").text
        assert "登录" in stand.stranger().get("/account/sign-in", headers={"accept-language": "zh"}).text


def test_programs_are_answered_in_english_whatever_their_browser_prefers() -> None:
    with console_stand() as stand:
        answer = stand.owner().get("/api/v1/missions/msn_nowhere", headers={"accept-language": "zh"})
        assert answer.status_code == 404 and answer.json()["detail"].isascii()
