"""Shapes the site's own missions and the form that changes one by its YAML, and says what is wrong with it here."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import yaml

from app.i18n.catalogues import N_
from app.i18n.languages import explained
from app.views.forms import Wrong
from app.views.place_editor import FieldValue, Version
from app.views.shell import Shell
from harness.contracts import ports
from harness.contracts.capabilities import Vocabulary
from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.places import Site
from harness.contracts.reasons import because
from harness.contracts.tasks import TaskTemplate
from harness.contracts.values import Value
from harness.projections.site_changes import SiteChanges
from harness.workspace.checks import mission_problems
from harness.workspace.contract_yaml import Lines, read_yaml

TITLE = N_("Own missions")
SLUG = re.compile(r"[a-z0-9][a-z0-9-]{0,59}")


class OwnMission(Value):
    """One mission of the site's own: its YAML, and how often people changed it here."""

    name: str
    title: str
    goal: str
    text: str
    revision: int


@dataclass(frozen=True)
class OwnMissionsPage:
    """All missions of the site's own folder."""

    shell: Shell
    missions: tuple[OwnMission, ...]


@dataclass(frozen=True)
class TemplateForm:
    """The editor. `basis` is the revision it was filled from."""

    shell: Shell
    name: str
    new: bool
    basis: int
    removed: bool
    text: FieldValue
    reason: FieldValue
    errors: tuple[str, ...]
    versions: tuple[Version, ...]


def own_missions(
    templates: Sequence[TaskTemplate], changes: SiteChanges, texts: Mapping[str, str]
) -> tuple[OwnMission, ...]:
    """Each with the YAML that somebody wrote here, else that of its file."""
    return tuple(
        OwnMission(
            name=one.name,
            title=one.title,
            goal=one.goal,
            text=text_of(one, changes, texts),
            revision=changes.template_revision(one.name),
        )
        for one in templates
    )


def text_of(template: TaskTemplate, changes: SiteChanges, texts: Mapping[str, str]) -> str:
    """A mission's YAML; one whose file nobody read is written out."""
    change = changes.templates.get(template.name)
    written = change.text if change is not None else texts.get(template.name, "")
    if written:
        return written
    found: str = yaml.safe_dump(msgspec.to_builtins(template), sort_keys=False, allow_unicode=True, width=110)
    return found


def template_form(
    shell: Shell,
    typed: Mapping[str, str],
    *,
    basis: int,
    wrong: Sequence[Wrong] = (),
    versions: Sequence[Version] = (),
    new: bool = False,
    removed: bool = False,
) -> TemplateForm:
    """The form as the person left it."""
    beside: dict[str, str] = {}
    for one in wrong:
        beside.setdefault(one.field, one.text)
    return TemplateForm(
        shell=shell,
        name=typed.get("name", ""),
        new=new,
        basis=basis,
        removed=removed,
        text=FieldValue(value=typed.get("text", ""), wrong=beside.get("text", "")),
        reason=FieldValue(value=typed.get("reason", ""), wrong=beside.get("reason", "")),
        errors=tuple(one.text for one in wrong),
        versions=tuple(versions),
    )


def read_template(
    text: str,
    *,
    name: str,
    known: bool,
    taken: Sequence[str],
    site: Site,
    vocabulary: Vocabulary,
    predicates: ports.Predicates,
) -> TaskTemplate | list[Wrong]:
    """The mission, where it could be started here with its defaults; else everything that `regen check` would say.

    `name`: what it must be called; empty where its YAML says that. One that is not `known` may have no name that is
    `taken`.
    """
    file = Path(f"{name or 'mission'}.yaml")
    try:
        template = read_yaml(text, TaskTemplate, where=str(file), foreign=True)
        _check_name(template.name, name, known=known, taken=taken, where=f"{file}:{Lines(text).of('name')}")
    except HarnessError as error:
        return [Wrong("text", explained(error))]
    problems = mission_problems(template, site, file, Lines(text), vocabulary=vocabulary, predicates=predicates)
    return [Wrong("text", explained(one)) for one in problems] or template


def _check_name(found: str, name: str, *, known: bool, taken: Sequence[str], where: str) -> None:
    """Raises ContractInvalid."""
    if name and found != name:
        raise ContractInvalid(because("mission_renamed", name=name, found=found[:80]), where=where)
    if not known and not SLUG.fullmatch(found):
        raise ContractInvalid(because("mission_name_unusable", name=found[:80]), where=where)
    if not known and found in taken:
        raise ContractInvalid(because("mission_name_taken", name=found[:80]), where=where)
