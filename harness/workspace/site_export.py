"""Writes the places, routes, own missions and robots of a site back to the YAML of its folder; the rest keeps its text
and comments.
"""

from collections.abc import Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any

import msgspec

from harness.contracts.places import Place, Route, Site
from harness.projections.site_changes import SiteChanges
from harness.workspace.reading import MISSIONS, Workspace
from harness.workspace.robot_entries import entry_texts

LISTS: Mapping[str, str] = {"places": "place_id", "routes": "name"}
"""The lists of site.yaml that are written back, and the key that names their items."""


def exported(text: str, *, before: Site, now: Site) -> str:
    """site.yaml with the changes from `before`, as the folder has it, to `now`, as the log has it.

    Equal to `text` where nothing changed.
    """
    if before.places == now.places and before.routes == now.routes:
        return text
    yaml = _yaml()
    document = yaml.load(text)
    for key, name in LISTS.items():
        old = {getattr(one, name): one for one in getattr(before, key)}
        new = {getattr(one, name): one for one in getattr(now, key)}
        _update(document[key], old, new, name)
    return _dumped(yaml, document)


def exported_robots(workspace: Workspace, changes: SiteChanges) -> str:
    """robots.yaml with the changes from the console. Equal to its text where nothing differs from it."""
    text, texts = workspace.files.robots_text, entry_texts(workspace.files.robots_text)
    changed = {name: one.text for name, one in changes.robots.items() if one.text != texts.get(name, "")}
    if not changed:
        return text
    yaml = _yaml()
    document = yaml.load(text)
    items = document["robots"]
    for index in range(len(items) - 1, -1, -1):
        name = str(items[index]["name"])
        if changed.get(name) == "":
            del items[index]
        elif name in changed:
            items[index] = yaml.load(changed[name])
    items.extend(yaml.load(one) for name, one in changed.items() if one and name not in texts)
    return _dumped(yaml, document)


def _yaml() -> Any:
    """A reader and writer that keeps comments and quotes."""
    from ruamel.yaml import YAML  # noqa: PLC0415  it loads slowly, and no other command needs it

    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.width = 120
    yaml.indent(mapping=2, sequence=4, offset=2)
    return yaml


def _dumped(yaml: Any, document: Any) -> str:
    out = StringIO()
    yaml.dump(document, out)
    return out.getvalue()


def exported_missions(workspace: Workspace, changes: SiteChanges) -> dict[Path, str | None]:
    """The files of missions that people changed, as they shall be; None for one to be deleted. Files that say so
    already are left out."""
    found: dict[Path, str | None] = {}
    for name, change in changes.templates.items():
        file = workspace.mission_files.get(name)
        if change.template is None:
            found |= {file: None} if file is not None else {}
        elif change.text != workspace.files.missions.get(name):
            found[file or workspace.folder / MISSIONS / f"{name}.yaml"] = change.text
    return found


def _update(items: Any, old: Mapping[str, Place | Route], new: Mapping[str, Place | Route], name: str) -> None:
    """Change the items that differ, key by key; drop and append the others. `items` is a list with its comments."""
    for index in range(len(items) - 1, -1, -1):
        found = str(items[index][name])
        if found not in new:
            del items[index]
        elif old.get(found) != new[found]:
            _change(items[index], _plain(old[found]), _plain(new[found]))
    for found, one in new.items():
        if found not in old:
            items.append(_flowing(_plain(one)))


def _change(item: Any, old: Mapping[str, Any], new: Mapping[str, Any]) -> None:
    for key, value in new.items():
        if old.get(key) != value:
            item[key] = _flowing({key: value})[key]
    for key in old.keys() - new.keys():
        item.pop(key, None)


def _plain(one: Place | Route) -> dict[str, Any]:
    """As YAML holds it: lists for points, nothing for what is unset."""
    found: dict[str, Any] = msgspec.to_builtins(one)
    return found


def _flowing(values: Mapping[str, Any]) -> dict[str, Any]:
    """Points and lists of points on one line each, as people write them."""
    from ruamel.yaml.comments import CommentedSeq  # noqa: PLC0415  as above

    def line(value: Any) -> Any:
        if not isinstance(value, Sequence) or isinstance(value, str):
            return value
        made = CommentedSeq([line(one) for one in value])
        made.fa.set_flow_style()
        return made

    return {key: line(value) for key, value in values.items()}
