"""The how-to pages are followed as they stand: here what needs no robot, in this process; `make howto` all of it."""

import os
import shlex
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli.main import app
from tools.howto import PAGES, ROOT, steps

PAGE = ROOT / "docs" / "how-to"
RUNS_A_ROBOT = ("python ", "sleep ", "provider check", "mission run", "regen up")


def follow(block: str, folder: Path) -> None:
    """Run a block line by line: `regen` in this process, what stands between by a shell."""
    between: list[str] = []
    for line in [*block.splitlines(), "regen"]:
        if not line.startswith("regen"):
            between.append(line)
            continue
        shell = subprocess.run(["bash", "-ec", "\n".join(between)], cwd=folder, capture_output=True, text=True)
        assert shell.returncode == 0, shell.stderr
        between.clear()
        command, _, otherwise = line.partition("||")
        words = shlex.split(command)[1:]
        if words:
            done = CliRunner().invoke(app, words)
            assert (done.exit_code == 0) is not bool(otherwise), f"{line}\n{done.output}\n{done.exception}"


@pytest.mark.parametrize("page", ["my-own-site", "my-own-mission", "voice-and-messages"])
def test_the_page_does_what_it_says(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("docs", "harness"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    blocks = [one["sh"] for one in steps(PAGE / f"{page}.md") if "sh" in one]
    quiet = [one for one in blocks if not any(word in one for word in RUNS_A_ROBOT)]
    assert len(quiet) >= 2
    for block in quiet:
        follow(block, tmp_path)
    assert set(os.listdir(tmp_path)) > {"docs", "harness"}, "the page wrote something"


def test_every_page_has_steps_and_one_of_them_starts_a_mission_in_the_console() -> None:
    every = {name: steps(PAGE / f"{name}.md") for name in PAGES}
    assert all(every.values())
    assert any("port" in step for step in every["attach-my-robot"])
