"""Shapes the form that changes something by its YAML: a mission of the site's own, or a robot of the site."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from app.i18n.languages import explained
from app.views.editor_fields import FieldValue, Version
from app.views.forms import Wrong
from app.views.shell import Shell
from harness.contracts.errors import HarnessError


@dataclass(frozen=True)
class YamlForm:
    """The editor of what one YAML text says. `basis` is the revision it was filled from."""

    shell: Shell
    name: str
    new: bool
    basis: int
    removed: bool
    text: FieldValue
    reason: FieldValue
    errors: tuple[str, ...]
    versions: tuple[Version, ...]


def yaml_form(
    shell: Shell,
    typed: Mapping[str, str],
    *,
    basis: int,
    wrong: Sequence[Wrong] = (),
    versions: Sequence[Version] = (),
    new: bool = False,
    removed: bool = False,
) -> YamlForm:
    """The form as the person left it."""
    beside: dict[str, str] = {}
    for one in wrong:
        beside.setdefault(one.field, one.text)
    return YamlForm(
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
    """What is wrong with the YAML, beside its field."""
    return [Wrong("text", explained(one)) for one in errors]
