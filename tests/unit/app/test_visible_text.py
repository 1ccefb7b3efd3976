"""Characters that nobody sees are found, shown and escaped; what scripts need stays."""

import json

import pytest

from app.acts.missions import StartMissionAct, StopMissionAct
from app.cli import output
from app.i18n.visible_text import UNSEEN, escaped, unseen_in, visible, visible_at_terminal
from harness.contracts.errors import ContractInvalid

NASTY = "go\x1b[2J\x07 to \u202ethe dock\u2066\u200b\x9b31m\ud800\U000e0041"


def test_every_unseen_character_is_shown_by_a_sign_or_its_code() -> None:
    assert visible("a\x1bb\x07\u202e") == "a\u241bb\u2407\u27e8U+202E\u27e9"
    assert not UNSEEN.search(visible(NASTY))
    plain = "检查 走廊\tλ 👩‍🚀 می‌خواهم\nline"
    assert visible(plain) == plain
    assert visible_at_terminal("safe\rlie\r\n") == "safe\u240dlie\r\n"


def test_json_says_the_same_and_holds_none_raw() -> None:
    text = escaped(json.dumps({"goal": NASTY}, ensure_ascii=False))
    assert not UNSEEN.search(text)
    assert json.loads(text) == {"goal": NASTY}


def test_they_are_found_in_lists_and_mappings_too() -> None:
    assert unseen_in({"a": ["b", {"\u202e": 1}]}) == "U+202E"
    assert unseen_in({"a": 1.0, "b": ("c",)}) == ""


@pytest.mark.parametrize("given", [{"goal": NASTY}, {"labels": {"note": "\x1b"}}, {"arguments": {"to": "a\u202e"}}])
def test_no_act_takes_such_a_text(given: dict[str, object]) -> None:
    with pytest.raises(ContractInvalid):
        StartMissionAct.of(**given)


def test_a_form_says_which_character_to_leave_out() -> None:
    (wrong,) = StopMissionAct.from_form({"reason": "because \u202e"})  # type: ignore[misc]
    assert "U+202E" in str(wrong.text)


def test_a_terminal_is_never_steered_by_a_text(capsys: pytest.CaptureFixture[str]) -> None:
    output.show({"goal": NASTY}, as_json=False, lines=[NASTY])
    output.show({"goal": NASTY}, as_json=True, lines=[])
    shown = capsys.readouterr().out
    assert not UNSEEN.search(shown)
