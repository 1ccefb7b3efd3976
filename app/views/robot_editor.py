"""Shapes the list of the site's robots, each with the YAML of its entry and whether that is in force yet."""

from collections.abc import Mapping
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.views.shell import Shell
from harness.contracts.values import Value
from harness.projections.site_changes import SiteChanges

TITLE = N_("Robots of the site")
KINDS: Mapping[str, str] = {
    "simulator": N_("of the simulator"),
    "http": N_("provider protocol over HTTP"),
    "vda5050": N_("VDA 5050"),
}


class OwnRobot(Value):
    """One robot of the site: its entry's YAML, and how often people changed it here. `in_force`: this process started
    with the entry as it stands; else it counts from the next start.
    """

    name: str
    kind: str
    address: str
    observed: bool
    text: str
    revision: int
    in_force: bool


@dataclass(frozen=True)
class OwnRobotsPage:
    """All robots of the site's folder with the changes from here; `removed` ones are still driven until the next start.

    `from_folder`: False where the start named its robots, so that nothing here counts.
    """

    shell: Shell
    robots: tuple[OwnRobot, ...]
    removed: tuple[str, ...]
    from_folder: bool
    kinds: Mapping[str, str]

    @property
    def waits(self) -> bool:
        """Whether something counts from the next start only."""
        return bool(self.removed) or any(not one.in_force for one in self.robots)


def removed_robots(changes: SiteChanges, revisions: Mapping[str, int]) -> tuple[str, ...]:
    """Robots that were removed here after this process started with them."""
    gone = (name for name, change in changes.robots.items() if not change.text)
    return tuple(name for name in gone if changes.robot_revision(name) != revisions.get(name, 0))
