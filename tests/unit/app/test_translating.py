"""Which language a reader gets, which words of a template are said in it, and what is never touched."""

from datetime import UTC, datetime
from pathlib import Path

import pytest
from starlette.datastructures import Headers

from app.i18n.catalogues import catalogue
from app.i18n.languages import localise, preferred
from app.i18n.messages import Message, lazy_gettext, listed
from app.web.filters import duration, instant, named, words
from app.web.rendering import environment
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


def rendered(tmp_path: Path, source: str, language: str = ZH, **values: object) -> str:
    """A template of these words in a language."""
    (tmp_path / "page.html").write_text(source, encoding="utf-8")
    return environment(tmp_path, language).get_template("page.html").render(**values)


def test_a_marked_text_is_translated_its_holes_are_escaped_and_its_markup_stays(tmp_path: Path) -> None:
    source = """<p title="{{ _('Search') }}">{% trans name=who.name, robot_id=robot %}
        {{ name }} drives {{ robot_id }} from {{ device }}.
    {% endtrans %}</p>"""
    values = {"who": {"name": "<b>ada"}, "robot": "vbot-1", "device": named("robot")}
    assert rendered(tmp_path, source, "en", **values) == (
        '<p title="Search">&lt;b&gt;ada drives vbot-1 from robot.</p>'
    )
    assert rendered(tmp_path, source, **values) == '<p title="搜索">&lt;b&gt;ada 正在驾驶 vbot-1，设备：robot。</p>'


def test_a_hole_is_shown_in_the_readers_language_too(tmp_path: Path) -> None:
    source = "{% trans until=left %}{{ until }} left{% endtrans %}"
    assert rendered(tmp_path, source, left=duration(161)) == "剩余 2 分 41 秒"


def test_a_lazy_message_is_localised_wherever_it_is_shown_and_plain_text_where_the_template_says_so(
    tmp_path: Path,
) -> None:
    source = '{{ lazy }} <i data-state="{{ plain }}">{{ plain | localise }}</i>'
    shown = rendered(tmp_path, source, lazy=lazy_gettext("{seconds} s", seconds="1.0"), plain="running")
    assert shown == '1.0 秒 <i data-state="running">运行中</i>'


def test_a_number_chooses_its_plural(tmp_path: Path) -> None:
    source = "{% trans num=n %}one row{% pluralize %}{{ num }} rows{% endtrans %}"
    assert [rendered(tmp_path, source, "en", n=n) for n in (1, 2)] == ["one row", "2 rows"]


def test_a_list_is_separated_as_its_language_does_and_a_name_is_no_word_of_it() -> None:
    assert localise(listed(("operator", "admin", "ada")), ZH) == "操作员、管理员、ada"
    assert (listed(()), listed(("operator",)), listed(("a", "b"))) == ("", "operator", "a, b")
    assert localise(named("operator"), ZH) == "operator"


def test_what_was_said_with_fields_is_said_again_in_the_readers_language() -> None:
    text = lazy_gettext("{actor} asked to stop: {reason}", actor="ada", reason="smoke")
    assert isinstance(text, str) and text == "ada asked to stop: smoke"
    assert localise(text, ZH) == "ada 请求停止：smoke"
    assert localise(text, "en") is text


def test_what_a_person_typed_is_never_a_template() -> None:
    text = lazy_gettext("{actor} asked to stop: {reason}", actor="{reason}", reason="{0.__class__}")
    assert localise(text, ZH) == "{reason} 请求停止：{0.__class__}"
    assert words("{odd}_slug") == "{odd} slug"


def test_words_instants_and_durations_follow_the_language() -> None:
    at_s = datetime(2026, 11, 20, 9, 30, 5, tzinfo=UTC).timestamp()
    assert (instant(at_s), localise(instant(at_s), ZH)) == ("2026-11-20 09:30:05 UTC", "2026年11月20日 09:30:05 UTC")
    assert (duration(161), localise(duration(161), ZH)) == ("2 min 41 s", "2 分 41 秒")
    assert (words("awaiting_human"), localise(words("awaiting_human"), ZH)) == ("awaiting human", "等待人回答")


def test_markup_numbers_and_unknown_words_stay_as_they_are() -> None:
    for value in (Message("nobody translated this {x}", {"x": 1}), "msn_00000001", 4, None):
        assert localise(value, ZH) == value
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
