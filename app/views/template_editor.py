"""Shapes the site's own missions and the form that changes one by its YAML."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import msgspec
import yaml

from app.i18n.catalogues import N_
from app.i18n.languages import explained
from app.views.forms import Wrong
from app.views.place_editor import FieldValue, Version
from app.views.shell import Shell
from harness.contracts.errors import HarnessError
from harness.contracts.tasks import TaskTemplate
from harness.contracts.values import Value
from harness.projections.site_changes import SiteChanges

TITLE = N_("Own missions")


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


def wrong_text(errors: Iterable[HarnessError]) -> list[Wrong]:
    """What is wrong with a mission's YAML, beside its field."""
    return [Wrong("text", explained(one)) for one in errors]
