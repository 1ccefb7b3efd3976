"""Checks that what the documents refer to exists: linked files and make targets."""

import re
from collections.abc import Iterator

from tests.architecture.sources import ROOT, kept_files

ISSUE_TARGETS = {"install", "run", "test", "lint", "types", "architecture", "ledger", "bench", "campaign", "check"}


def documents() -> Iterator[tuple[str, str]]:
    """(path, text) of every document."""
    yield from ((path, (ROOT / path).read_text(encoding="utf-8")) for path in kept_files() if path.endswith(".md"))


def dead_links(path: str, text: str) -> list[str]:
    """Relative links that lead nowhere."""
    links = [link.partition("#")[0] for link in re.findall(r"\]\(([^)\s]+)\)", text) if "://" not in link]
    folder = (ROOT / path).parent
    return [f"{path}: {link}" for link in links if link and not (folder / link).exists()]


def targets() -> set[str]:
    """Targets of the Makefile that have a description."""
    return set(re.findall(r"^([a-z-]+):.*##", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))


def test_every_relative_link_leads_somewhere() -> None:
    assert [link for path, text in documents() for link in dead_links(path, text)] == []


def test_a_dead_link_is_found() -> None:
    assert dead_links("README.md", "[a](docs/nowhere.md) [b](https://example.org) [c](LICENSE) [d](#e)") == [
        "README.md: docs/nowhere.md"
    ]


def test_every_make_target_that_is_named_exists() -> None:
    named = {name for _, text in documents() for name in re.findall(r"`make ([a-z-]+)", text)}
    assert (named | ISSUE_TARGETS) - targets() == set()


def test_continuous_integration_runs_the_same_names() -> None:
    called = re.search(r"make ((?:[a-z-]+ ?)+)", (ROOT / ".ci" / "run").read_text(encoding="utf-8"))
    assert called is not None
    assert "test" in called.group(1).split()
    assert set(called.group(1).split()) <= targets()
