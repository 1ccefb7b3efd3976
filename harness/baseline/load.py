"""H_0 and the site as they ship: reads this package's own data into contract values."""

from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from harness.contracts.configuration import Configuration, ContextRules, RecoveryPolicy, RoutingPreferences
from harness.contracts.places import Site
from harness.contracts.tasks import TaskTemplate
from harness.contracts.values import Value, decode
from harness.recovery.policy import check_policy
from harness.workspace.contract_yaml import read_yaml
from harness.workspace.reading import Workspace, open_workspace

_PACKAGE = "harness.baseline"


class _Sections(Value):
    """configuration.yaml: three of the four sections; the fourth, the templates, has a file each."""

    context_rules: ContextRules
    routing: RoutingPreferences
    recovery: RecoveryPolicy


@lru_cache(maxsize=1)
def baseline() -> Configuration:
    """H_0, with its templates in order of their names, read once.

    Raises ContractInvalid if the shipped files break a rule.
    """
    sections = read_yaml(_shipped("configuration.yaml"), _Sections, where="baseline/configuration.yaml")
    templates = _templates("templates")
    configuration = Configuration(
        context_rules=sections.context_rules,
        templates=templates,
        routing=sections.routing,
        recovery=sections.recovery,
    )
    check_policy(configuration.recovery)
    return configuration


@lru_cache(maxsize=1)
def earlier() -> tuple[Configuration, ...]:
    """H_0 as earlier releases shipped it, read once: their logs pin missions to it and hold no copy."""
    folder = files(_PACKAGE).joinpath("earlier")
    entries = sorted((one for one in folder.iterdir() if one.name.endswith(".json")), key=lambda one: one.name)
    return tuple(decode(entry.read_bytes(), Configuration) for entry in entries)


@lru_cache(maxsize=1)
def shipped_workspace() -> Workspace:
    """The simulated site's folder: its places, its robot and its missions, read once.

    Its missions ship beside H_0 and are no part of it; they run under their robot's current configuration as any
    other, and no candidate changes them.
    """
    return open_workspace(Path(__file__).with_name("site"), reserved=shipped_missions(), foreign=False)


def site() -> Site:
    """The simulated site's places, routes, passages and zones."""
    return shipped_workspace().site


def shipped_missions() -> tuple[str, ...]:
    """The names that no mission of a site's own folder may have: those of H_0's templates."""
    return tuple(template.name for template in baseline().templates)


def workspace_in(folder: Path | None) -> Workspace:
    """The site's own folder, or the simulated site without one. Raises as `open_workspace` does."""
    return shipped_workspace() if folder is None else open_workspace(folder, reserved=shipped_missions())


def _templates(name: str) -> tuple[TaskTemplate, ...]:
    folder = files(_PACKAGE).joinpath(name)
    entries = sorted(entry.name for entry in folder.iterdir() if entry.name.endswith(".yaml"))
    texts = ((entry, folder.joinpath(entry).read_text(encoding="utf-8")) for entry in entries)
    return tuple(read_yaml(text, TaskTemplate, where=f"baseline/{name}/{entry}") for entry, text in texts)


def _shipped(name: str) -> str:
    return files(_PACKAGE).joinpath(name).read_text(encoding="utf-8")
