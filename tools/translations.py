"""What the console says and how it is said in other languages: `python -m tools.translations` mends the catalogues.

Messages are read from the sources: texts of templates, what scripts hand to `tr`, what views hand to `said`, sentences
that views keep as constants, and the words of the contracts. Mending adds what is missing, empty, and drops what
nobody says any more; exit 1 while something is missing, stale or broken.
"""

import ast
import re
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import get_args

from babel.messages.catalog import Catalog
from babel.messages.pofile import read_po, write_po

from app.languages import ENGLISH, FOLDER, LOCALES
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

VIEWS = ("app/views", "app/routes/handoff_words.py", "app/errors.py", "app/permissions.py", "app/filters.py")
"""Where constants that persons read are kept, beside the templates."""
VOCABULARY = (
    alert_events.AlertKind, alert_events.Priority, capabilities.Capability, configuration.FailureClass,
    configuration.RecoveryAction, control.Autonomy, control.Posture, effects.FactKind, handoff_events.NoAnswer,
    handoff_events.EscalationLevel, memory.MemoryRole, memory.Standing, memory.Verification, observations.Origin,
    observations.Source, protocol.InvocationStatus, verdicts.Verdict, alerts.AlertStatus, handoffs.HandoffStatus,
    handoffs.Decided, missions.MissionStatus, missions.NodeStatus,
)  # fmt: skip
NOT_YET = (
    "templates/account/index.html", "templates/account/people.html", "templates/audit/", "templates/candidates/",
    "templates/evaluation/", "templates/evidence/", "templates/memory/", "templates/missions/packet.html",
    "templates/places/", "templates/providers/", "templates/releases/", "app/views/audit.py", "app/views/canary.py",
    "app/views/evidence.py", "app/views/place_editor.py", "app/views/providers.py", "app/views/review.py",
)  # fmt: skip
"""Said in English alone so far: pages of reviewers, releasers and administrators, and the depth of the evidence."""
HOLE = re.compile(r"\{(\w*)\}")
_SENTENCE = re.compile(r"[A-Z“][^{}<>/_\\]*\s[^{}<>_\\]*[.!?:]")


@cache
def said() -> dict[str, str]:
    """Every message that must be translated -> where it is said first."""
    found: dict[str, str] = {}
    for message, where in _all():
        found.setdefault(message, where)
    return found


@cache
def known() -> set[str]:
    """Every text that may stand in a catalogue: what must, and every other constant that a view can show."""
    templates = [path.read_text(encoding="utf-8") for path in (ROOT / "templates").rglob("*.html")]
    return (
        {one for one, _ in _everything()}
        | {one for path in _views() for one in _constants(path)}
        | {one for text in templates for one in quoted(text)}
        | {one for path in (ROOT / "app" / "routes").glob("*.py") for one in _constants(path)}
    )


def wrong(catalogue: Mapping[str, str]) -> list[str]:
    """What is missing, stale or broken in a catalogue, a line each."""
    must, may = said(), known()
    found = [f"missing: {one!r} ({where})" for one, where in must.items() if not catalogue.get(one)]
    found += [f"stale: {one!r}" for one in catalogue if one not in may]
    for message, text in catalogue.items():
        if text and sorted(set(HOLE.findall(message))) != sorted(set(HOLE.findall(text))):
            found.append(f"holes differ: {message!r} -> {text!r}")
        if re.search(r"[<>]|\{\{|\{%", text):
            found.append(f"markup: {text!r}")
    return found


def catalogue_path(locale: str) -> Path:
    return FOLDER / locale / "LC_MESSAGES" / "messages.po"


def read(locale: str) -> dict[str, str]:
    """Message -> translation, empty where there is none yet."""
    path = catalogue_path(locale)
    if not path.is_file():
        return {}
    with path.open("rb") as file:
        return {str(one.id): str(one.string) for one in read_po(file, locale=locale) if one.id}


def mended(catalogue: Mapping[str, str]) -> dict[str, str]:
    """The same with what is missing, empty, and without what is stale."""
    must, may = said(), known()
    return {one: text for one, text in catalogue.items() if one in may and (text or one in must)} | {
        one: "" for one in must if one not in catalogue
    }


def write(locale: str, catalogue: Mapping[str, str]) -> None:
    """As a gettext file, sorted, without dates: two runs write the same bytes."""
    where = said()
    book = Catalog(locale=locale, project="RegenHarness", fuzzy=False)
    for message in sorted(catalogue):
        spot = where.get(message, "")
        book.add(message, catalogue[message], auto_comments=[spot] if spot else [])
    path = catalogue_path(locale)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        write_po(file, book, width=120, omit_header=True)


def main() -> None:
    """Mend every catalogue and say what is left to do."""
    left = []
    for locale in (one for tag, one in LOCALES.items() if tag != ENGLISH):
        write(locale, mended(read(locale)))
        left += [f"{locale}: {one}" for one in wrong(read(locale))]
    if left:
        sys.exit("\n".join(left))
    print("Every message is said in every language.")


def _all() -> Iterator[tuple[str, str]]:
    yield from ((one, where) for one, where in _everything() if not where.startswith(NOT_YET))


def _everything() -> Iterator[tuple[str, str]]:
    for path in sorted((ROOT / "templates").rglob("*.html")):
        yield from ((one, _name(path)) for one in messages(path.read_text(encoding="utf-8")))
    for path in sorted((ROOT / "static" / "js").glob("*.js")):
        yield from ((one, _name(path)) for one in script_messages(path.read_text(encoding="utf-8")))
    for path in _views():
        yield from ((one, _name(path)) for one in _handed(path))
        yield from ((one, _name(path)) for one in _constants(path) if _SENTENCE.fullmatch(one))
    for kind in VOCABULARY:
        yield from ((str(one).replace("_", " "), "harness/contracts") for one in get_args(kind) if one)


def _views() -> Iterator[Path]:
    for part in VIEWS:
        path = ROOT / part
        yield from sorted(path.glob("*.py")) if path.is_dir() else (path,)


def _handed(path: Path) -> Iterator[str]:
    """The literals that are handed to `said`."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "said":
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


if __name__ == "__main__":
    main()
