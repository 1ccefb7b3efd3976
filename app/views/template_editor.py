"""Shapes the list of the site's own missions, each with its YAML."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import msgspec
import yaml

from app.i18n.catalogues import N_
from app.views.shell import Shell
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
