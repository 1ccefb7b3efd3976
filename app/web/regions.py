"""The table of the mission page's regions: name, content, and the signals that refresh each.

From a name come the template (`missions/_name.html`), the element (`#name`) and the address (`/missions/{id}/name`).
"""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Region:
    """One part of the page that is fetched alone. `triggers` are its signals in the syntax of htmx."""

    name: str
    triggers: str

    @property
    def template(self) -> str:
        return f"missions/_{self.name}.html"


def _region(name: str, *signals: str) -> Region:
    """A region with its triggers; the signal "observations 2s" refreshes it every two seconds at most."""
    parts = [one.partition(" ") for one in ("mission", *signals)]
    triggers = [f"live:{signal} from:body{f' throttle:{pause}' if pause else ''}" for signal, _, pause in parts]
    return Region(name=name, triggers=", ".join(triggers))


TABLE = (
    _region("head"),
    _region("robot", "observations 1s"),
    _region("graph"),
    _region("stages", "observations 500ms"),
    _region("budget"),
    _region("view", "observations 3s", "scene"),
    _region("timeline"),
    _region("plots", "observations 2s"),
    _region("frames"),
    _region("contract"),
    _region("facts"),
    _region("evidence"),
    _region("contexts"),
    _region("proposers"),
    _region("events"),
)
REGIONS: Mapping[str, Region] = {one.name: one for one in TABLE}
