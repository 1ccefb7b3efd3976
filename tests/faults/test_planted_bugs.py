"""Bugs planted on purpose: a campaign that does not see them is no evidence."""

from pathlib import Path

import pytest

from experiments.campaigns.planted_bugs import BUGS, Bug, Edit, edited, planted_bugs
from experiments.campaigns.regen import ROOT

QUICK = ("no cycle check at the handoff", "planner text let into C3", "lease without fencing", "outbox not atomic",
         "declared effect committed")  # fmt: skip


@pytest.mark.parametrize("bug", BUGS, ids=lambda bug: bug.name)
def test_every_bug_still_fits_the_code_that_it_breaks(bug: Bug) -> None:
    for edit in bug.edits:
        source = (ROOT / edit.file).read_text(encoding="utf-8")
        broken = edited(source, edit)
        assert broken != source
        compile(broken, edit.file, "exec")


def test_a_bug_that_no_longer_fits_says_so() -> None:
    with pytest.raises(ValueError, match="has no nobody"):
        edited("def somebody():\n    return 1\n", Edit(file="x.py", function="nobody", new="return 2"))
    with pytest.raises(ValueError, match="stands 0 times"):
        edited(
            "def somebody():\n    return 1\n", Edit(file="x.py", function="somebody", old="return 3", new="return 2")
        )


def test_an_edit_changes_one_function_and_nothing_else() -> None:
    source = "def a():\n    return 1\n\n\nclass B:\n    def a(self):\n        return 1\n"
    changed = edited(source, Edit(file="x.py", function="B.a", new="return 2"))
    assert changed == source[: source.rindex("return 1")] + "return 2\n"


@pytest.mark.parametrize("name", QUICK)
def test_a_planted_bug_is_caught(name: str, tmp_path: Path) -> None:
    report = planted_bugs(missions=3, seed=1, names=(name,))
    assert report.caught == report.total == 1
    assert report.seen[name]
