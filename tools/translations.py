"""What the console says and how it is said in other languages: `python -m tools.translations` mends the catalogues.

Messages are read from the sources: texts of templates, what scripts hand to `tr`, what views hand to `said`, sentences
that views keep as constants, the words of the contracts; and, in a catalogue apart, what the machinery says. Mending
adds what is missing, empty, and drops what nobody says any more; exit 1 while something is missing, stale or broken.
"""

import ast
import re
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import get_args

from babel.messages.catalog import Catalog
from babel.messages.pofile import read_po, write_po

from app import permissions
from app.catalogues import CONSOLE, ENGLISH, FOLDER, LOCALES
from app.catalogues import MACHINE as MACHINERY
from app.phrases import messages, quoted, script_messages
from app.settings import ROOT
from harness.contracts import (
    alert_events,
    capabilities,
    configuration,
    control,
    effects,
    handoff_events,
    memory,
    observations,
    protocol,
    verdicts,
)
from harness.projections import alerts, handoffs
from harness.projections import mission as missions
from rsi_reviews import contracts as reviewing
from rsi_reviews import pointers
from rsi_reviews import projections as reviews
from rsi_reviews.difference import NAMES
from rsi_reviews.evaluation.arms import ARMS
from rsi_reviews.evaluation.missions import CONDITIONS
from tools import machine_words

VIEWS = (
    "app/views", "app/acts", "app/routes", "app/errors.py", "app/permissions.py", "app/filters.py", "app/evaluated.py",
    "app/scene_feed.py", "app/scene.py", "app/report_pdf.py",
)  # fmt: skip
"""Where constants that persons read are kept, beside the templates."""
REASONS = "app/reasons"
"""Where the sentences of reasons are kept, each marked with `N_`."""
PROGRAMS = re.compile(r"(api\w*|metrics|live|scene)\.py")
"""Routes that answer programs alone."""
VOCABULARY = (
    alert_events.AlertKind, alert_events.Priority, capabilities.Capability, configuration.FailureClass,
    configuration.RecoveryAction, control.Autonomy, control.Posture, effects.FactKind, handoff_events.NoAnswer,
    handoff_events.EscalationLevel, memory.MemoryRole, memory.Standing, memory.Verification, observations.Origin,
    observations.Source, protocol.InvocationStatus, verdicts.Verdict, alerts.AlertStatus, handoffs.HandoffStatus,
    handoffs.Decided, missions.MissionStatus, missions.NodeStatus, permissions.Role, pointers.Draining, reviews.Status,
    reviewing.Answer, reviewing.Direction, reviewing.Family, reviewing.Metric,
)  # fmt: skip
PUBLISHED = (*NAMES.values(), *(one.text for one in ARMS), *(one.text for one in CONDITIONS))
"""What tables and published documents say in words of their own."""
MACHINE = ("harness", "simulator", "rsi_reviews")
"""Whose identifiers may be shown as words: names of quantities, of fields, of kinds."""
HOLE = re.compile(r"\{([\w:.+,%-]*)\}")
_SENTENCE = re.compile(r"[A-Za-z“](?:[^{}<>/_\\=$:\n]|:(?=\s|\Z))*")
_SOURCE = re.compile(r"-src\b|^live:")


@cache
def said() -> dict[str, str]:
    """Every message that must be translated -> where it is said first."""
    found: dict[str, str] = {}
    for message, where in _everything():
        found.setdefault(message, where)
    return found


@cache
def known() -> set[str]:
    """Every text that may stand in a catalogue: what must, and every other constant that a view can show."""
    templates = [path.read_text(encoding="utf-8") for path in (ROOT / "templates").rglob("*.html")]
    return (
        set(said())
        | {one for path in _views() for one in _constants(path)}
        | {one for text in templates for one in quoted(text)}
        | _identifiers()
    )


@dataclass(frozen=True)
class Domain:
    """One catalogue of every language. `must`: message -> where it is said; `may`: what else may stand in it."""

    name: str
    must: Callable[[], Mapping[str, str]]
    may: Callable[[], Collection[str]]


def wrong(catalogue: Mapping[str, str], domain: str = CONSOLE) -> list[str]:
    """What is missing, stale or broken in a catalogue, a line each."""
    must, may = DOMAINS[domain].must(), DOMAINS[domain].may()
    found = [f"missing: {one!r} ({where})" for one, where in must.items() if not catalogue.get(one)]
    found += [f"stale: {one!r}" for one in catalogue if one not in may]
    for message, text in catalogue.items():
        if text and sorted(set(HOLE.findall(message))) != sorted(set(HOLE.findall(text))):
            found.append(f"holes differ: {message!r} -> {text!r}")
        if re.search(r"[<>]|\{\{|\{%", text):
            found.append(f"markup: {text!r}")
    return found


def catalogue_path(locale: str, domain: str = CONSOLE) -> Path:
    return FOLDER / locale / "LC_MESSAGES" / f"{domain}.po"


def read(locale: str, domain: str = CONSOLE) -> dict[str, str]:
    """Message -> translation, empty where there is none yet."""
    path = catalogue_path(locale, domain)
    if not path.is_file():
        return {}
    with path.open("rb") as file:
        return {str(one.id): str(one.string) for one in read_po(file, locale=locale) if one.id}


def mended(catalogue: Mapping[str, str], domain: str = CONSOLE) -> dict[str, str]:
    """The same with what is missing, empty, and without what is stale."""
    must, may = DOMAINS[domain].must(), DOMAINS[domain].may()
    return {one: text for one, text in catalogue.items() if one in may and (text or one in must)} | {
        one: "" for one in must if one not in catalogue
    }


def write(locale: str, catalogue: Mapping[str, str], domain: str = CONSOLE) -> None:
    """As a gettext file, sorted, without dates: two runs write the same bytes."""
    where = DOMAINS[domain].must()
    book = Catalog(locale=locale, project="RegenHarness", fuzzy=False)
    for message in sorted(catalogue):
        spot = where.get(message, "")
        book.add(message, catalogue[message], auto_comments=[spot] if spot else [])
    path = catalogue_path(locale, domain)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        write_po(file, book, width=120, omit_header=True)


def main() -> None:
    """Mend every catalogue and say what is left to do."""
    left = []
    for locale, name in product((one for tag, one in LOCALES.items() if tag != ENGLISH), DOMAINS):
        write(locale, mended(read(locale, name), name), name)
        left += [f"{locale}, {name}: {one}" for one in wrong(read(locale, name), name)]
    if left:
        sys.exit("\n".join(left))
    print("Every message is said in every language.")


def _everything() -> Iterator[tuple[str, str]]:
    for path in sorted((ROOT / "templates").rglob("*.html")):
        source = path.read_text(encoding="utf-8")
        yield from ((one, _name(path)) for one in (*messages(source), *filter(_sentence, quoted(source))))
    for path in sorted((ROOT / "static" / "js").glob("*.js")):
        yield from ((one, _name(path)) for one in script_messages(path.read_text(encoding="utf-8")))
    for path in _views():
        yield from ((one, _name(path)) for one in _handed(path))
        yield from ((one, _name(path)) for one in _constants(path) if _sentence(one))
    for path in sorted((ROOT / REASONS).glob("*.py")):
        yield from ((one, _name(path)) for one in _handed(path, "N_"))
    for kind in VOCABULARY:
        yield from ((str(one).replace("_", " "), "harness/contracts") for one in get_args(kind) if one)
    yield from ((one, "rsi_reviews") for one in PUBLISHED)


def _identifiers() -> set[str]:
    """Every identifier of the machinery, and every one without its unit, as words."""
    texts = [path.read_text(encoding="utf-8") for part in MACHINE for path in (ROOT / part).rglob("*.py")]
    found = {one for text in texts for one in re.findall(r"[a-z][a-z0-9_-]+", text)}
    words = {re.sub("[_-]", " ", one) for one in found}
    return words | {one.rpartition(" ")[0] for one in words}


def _views() -> Iterator[Path]:
    for part in VIEWS:
        path = ROOT / part
        found = sorted(path.glob("*.py")) if path.is_dir() else [path]
        yield from (one for one in found if path.is_file() or not PROGRAMS.fullmatch(one.name))


def _sentence(text: str) -> bool:
    """Whether a constant is something to read: words with a space between them, and no code."""
    inside = " " in text and text == text.strip()
    return inside and bool(_SENTENCE.fullmatch(text)) and not _SOURCE.search(text)


def _handed(path: Path, marker: str = "said") -> Iterator[str]:
    """The literals that are handed to a function of that name."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == marker:
            yield from (str(one.value) for one in node.args[:1] if isinstance(one, ast.Constant))


def _constants(path: Path) -> Iterator[str]:
    """Texts in the code: no documentation, no parts of other texts."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    skipped = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in ast.walk(node)}
    skipped |= {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in skipped and node.value:
            yield node.value


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


DOMAINS: Mapping[str, Domain] = {
    one.name: one
    for one in (Domain(CONSOLE, said, known), Domain(MACHINERY, machine_words.heard, machine_words.sentences))
}


if __name__ == "__main__":
    main()
