"""Updates the message catalogues of the console in every language: `python -m tools.translations`.

`pybabel extract` reads the messages from the sources as pyproject.toml maps them: templates, scripts, and what Python
passes to `lazy_gettext` and `N_`. The terms of the contracts, the meanings of a configuration's fields and the texts of
the task templates that ship are added here. Updating adds missing messages with an empty translation and drops unused
ones; exit 1 while something is missing, stale or broken.
"""

import re
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import get_args

from babel.messages.catalog import Catalog
from babel.messages.frontend import CommandLineInterface
from babel.messages.pofile import read_po, write_po

from app.auth import permissions
from app.i18n import task_texts
from app.i18n.catalogues import CATALOGUE, ENGLISH, FOLDER, LOCALES
from app.settings import ROOT
from harness.adapters.providers.messaging.read_back import SOURCE as READ_PATH
from harness.adapters.providers.speech.microphone import MICROPHONE
from harness.contracts import (
    alert_events,
    configuration,
    control,
    effects,
    handoff_events,
    memory,
    models,
    observations,
    protocol,
    retreat_events,
    verdicts,
)
from harness.contracts.fields import fields
from harness.projections import alerts, handoffs
from harness.projections import mission as missions
from harness.workspace.capability_types import shipped_vocabulary
from rsi_reviews import contracts as reviewing
from rsi_reviews import pointers
from rsi_reviews import projections as reviews
from rsi_reviews.difference import NAMES
from rsi_reviews.evaluation.arms import ARMS
from rsi_reviews.evaluation.missions import CONDITIONS
from rsi_reviews.evaluation.suites import CHECKS
from rsi_reviews.recursion.report import REFUTES

SOURCES = ("app", "static/js", "templates")
KEYWORDS = ("lazy_gettext", "tr")
"""Whose first argument is a message, beside gettext, ngettext, _ and N_, which Babel knows."""
VOCABULARY = (
    models.ModelRole,
    alert_events.AlertKind, alert_events.Priority, configuration.FailureClass,
    configuration.RecoveryAction, control.Autonomy, protocol.BodyPosture, effects.FactKind, handoff_events.NoAnswer,
    handoff_events.EscalationLevel, memory.MemoryRole, memory.RecordStanding, memory.Verification, observations.Origin,
    observations.Source, protocol.InvocationStatus, verdicts.Verdict, alerts.AlertStatus, handoffs.HandoffStatus,
    handoffs.Decided, retreat_events.RetreatOutcome, missions.MissionStatus, missions.NodeStatus,
    permissions.Role, pointers.Draining, reviews.Status,
    reviewing.Answer, reviewing.Direction, reviewing.Family, reviewing.Metric,
)  # fmt: skip
PUBLISHED = (
    *NAMES.values(), *(one.text for one in ARMS), *(one.text for one in CONDITIONS),
    *(claim for _, _, claim, _ in CHECKS),
    *REFUTES, "what the program ships", "accepted facts", MICROPHONE, READ_PATH,
)  # fmt: skip
"""What tables and published documents say in words of their own."""
MACHINE = ("harness", "simulator", "rsi_reviews")
"""Whose identifiers may be shown as words: names of quantities, of fields, of kinds."""
WORDS = re.compile(r"[A-Za-z]{2,} [A-Za-z]{2,}")
"""What is said in a language, not a number, a unit or a name."""
SLUGS = re.compile(r"\bone of |\bmatches ")
"""A bound that lists names, the same in every language."""
HOLE = re.compile(r"%\(\w+\)s|\{[\w:.+,%-]*\}")


@cache
def extracted() -> Catalog:
    """Everything that is marked in the sources, as Babel extracts it."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "messages.pot"
        marks = [f"--keyword={one}" for one in KEYWORDS]
        sources = [str(ROOT / one) for one in SOURCES]
        mapping = str(ROOT / "pyproject.toml")
        run: Callable[[list[str]], None] = CommandLineInterface().run
        run(["pybabel", "-q", "extract", "-F", mapping, *marks, "-o", str(path), *sources])
        with path.open("rb") as file:
            return read_po(file)


@cache
def catalogue_texts() -> dict[str, tuple[str, ...]]:
    """Every message that must be translated -> the files where it occurs."""
    found: dict[str, tuple[str, ...]] = {}
    for message, where in (*_marked(), *_vocabulary(), *_fields(), *task_texts.messages()):
        if where not in found.setdefault(message, ()):
            found[message] += (where,)
    return found


@cache
def known() -> set[str]:
    """Every text that may be in a catalogue: what must, and every identifier that may be shown as a word."""
    return set(catalogue_texts()) | _identifiers()


def wrong(catalogue: Mapping[str, str]) -> list[str]:
    """What is missing, stale or broken in a catalogue, a line each."""
    must, may = catalogue_texts(), known()
    found = [f"missing: {one!r} ({', '.join(where)})" for one, where in must.items() if not catalogue.get(one)]
    found += [f"stale: {one!r}" for one in catalogue if one not in may]
    for message, text in catalogue.items():
        if text and set(HOLE.findall(message)) != set(HOLE.findall(text)):
            found.append(f"holes differ: {message!r} -> {text!r}")
        if re.search(r"[<>]|\{\{|\{%", text):
            found.append(f"markup: {text!r}")
    return found


def catalogue_path(locale: str) -> Path:
    return FOLDER / locale / "LC_MESSAGES" / CATALOGUE


def read(locale: str) -> dict[str, str]:
    """Message -> translation, empty where there is none yet."""
    path = catalogue_path(locale)
    if not path.is_file():
        return {}
    with path.open("rb") as file:
        return {str(one.id): str(one.string) for one in read_po(file, locale=locale) if one.id}


def mended(catalogue: Mapping[str, str]) -> dict[str, str]:
    """The catalogue with missing messages added, empty, and stale ones removed."""
    must, may = catalogue_texts(), known()
    return {one: text for one, text in catalogue.items() if one in may and (text or one in must)} | {
        one: "" for one in must if one not in catalogue
    }


def write(locale: str, catalogue: Mapping[str, str]) -> None:
    """As a gettext file, sorted, without dates: two runs write the same bytes."""
    where = catalogue_texts()
    book = Catalog(locale=locale, project="RegenHarness", fuzzy=False)
    for message in sorted(catalogue):
        book.add(message, catalogue[message], locations=[(path, 0) for path in where.get(message, ())])
    path = catalogue_path(locale)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        write_po(file, book, width=120, omit_header=True, include_lineno=False)


def main() -> None:
    """Update every catalogue and report what is left to do."""
    left = []
    for locale in (one for tag, one in LOCALES.items() if tag != ENGLISH):
        write(locale, mended(read(locale)))
        left += [f"{locale}: {one}" for one in wrong(read(locale))]
    if left:
        sys.exit("\n".join(left))
    print("Every message is said in every language.")


def _marked() -> Iterator[tuple[str, str]]:
    for one in extracted():
        if one.id:
            yield from ((str(one.id), _name(Path(path))) for path, _ in one.locations)


def _vocabulary() -> Iterator[tuple[str, str]]:
    """The terms of the contracts that pages show."""
    yield from ((name.replace("_", " "), "harness/baseline") for name in shipped_vocabulary().names)
    for kind in VOCABULARY:
        yield from ((str(one).replace("_", " "), "harness/contracts") for one in get_args(kind) if one)
    yield from ((one, "rsi_reviews") for one in PUBLISHED)


def _fields() -> Iterator[tuple[str, str]]:
    """What the fields of a configuration mean, with their bounds, as far as these are words."""
    for field in fields():
        texts = (field.meaning, "" if SLUGS.search(field.bound) else field.bound)
        yield from ((text, "harness/contracts/fields.py") for text in texts if WORDS.search(text))


def _identifiers() -> set[str]:
    """Every identifier of the runtime, and each without its unit, as words."""
    texts = [path.read_text(encoding="utf-8") for part in MACHINE for path in (ROOT / part).rglob("*.py")]
    found = {one for text in texts for one in re.findall(r"[a-z][a-z0-9_-]+", text)}
    words = {re.sub("[_-]", " ", one) for one in found}
    return words | {one.rpartition(" ")[0] for one in words}


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix() if path.is_absolute() else path.as_posix()


if __name__ == "__main__":
    main()
