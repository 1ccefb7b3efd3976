"""Which robots of a site a process starts, connects and observes: those of robots.yaml with the changes from the
console, or those that its settings name.
"""

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field

from harness.adapters.stores.folder import existing
from harness.adapters.stores.log_address import open_log
from harness.baseline.load import workspace_in
from harness.contracts import ports
from harness.contracts.errors import StoreUnavailable
from harness.contracts.ids import RobotId
from harness.contracts.reasons import Reason
from harness.contracts.site_events import site_stream
from harness.gate.site_changes import DECIDER as CHANGES
from harness.settings import HarnessSettings
from harness.workspace.files import AddressedEntry, Authority, RobotEntry, SimulatedRobotEntry
from harness.workspace.reading import Workspace
from harness.workspace.robot_entries import with_changes


@dataclass(frozen=True)
class SiteRobots:
    """`simulated`: names of robots to start; `addressed`: those to connect; `observed`: those in shadow mode.

    `refused`: changes from the console that cannot be used any more, and why. `revisions`: how often the robots were
    changed there when this was read. `from_folder`: False where the settings name the robots, so that neither the file
    nor the changes count.
    """

    simulated: tuple[str, ...] = ()
    addressed: tuple[AddressedEntry, ...] = ()
    observed: tuple[AddressedEntry, ...] = ()
    refused: Mapping[RobotId, Reason] = field(default_factory=dict)
    revisions: Mapping[str, int] = field(default_factory=dict)
    from_folder: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Every robot that missions may be given to."""
        return (*self.simulated, *(one.name for one in self.addressed))

    @property
    def observed_names(self) -> frozenset[RobotId]:
        return frozenset(RobotId(one.name) for one in self.observed)


NO_SITE_ROBOTS = SiteRobots()


def robots_of(settings: HarnessSettings, workspace: Workspace, store: ports.EventStore | None) -> SiteRobots:
    """The robots of this site's folder with the changes in `store`; those of the settings where they name some."""
    if not _from_folder(settings):
        return SiteRobots(simulated=() if settings.no_robots else settings.fleet)
    saved = [CHANGES.codec.decode(one) for one in store.load(site_stream(workspace.site.name))] if store else []
    changes = CHANGES.fold(CHANGES.initial, saved).robots
    entries, refused = with_changes(workspace.robots, changes)
    driven = () if settings.no_robots else entries
    return SiteRobots(
        simulated=tuple(one.name for one in driven if isinstance(one, SimulatedRobotEntry)),
        addressed=_addressed(driven, "command"),
        observed=_addressed(entries, "observe"),
        refused=refused,
        revisions={name: one.revision for name, one in changes.items()},
        from_folder=True,
    )


def robot_names(settings: HarnessSettings) -> tuple[str, ...]:
    """Every robot that `open_harness` would start or connect. Raises as `workspace_in` does."""
    workspace = workspace_in(settings.site_folder)
    log = _log(settings) if _from_folder(settings) else ""
    if not log:
        return robots_of(settings, workspace, None).names
    with closing(open_log(log)) as store:
        return robots_of(settings, workspace, store).names


def _from_folder(settings: HarnessSettings) -> bool:
    """Whether the site's folder says which robots there are."""
    return settings.site_folder is not None and not settings.robots


def _addressed(entries: Sequence[RobotEntry], authority: Authority) -> tuple[AddressedEntry, ...]:
    addressed = (one for one in entries if not isinstance(one, SimulatedRobotEntry))
    return tuple(one for one in addressed if one.authority == authority)


def _log(settings: HarnessSettings) -> str:
    """Where the log is; empty where there is none yet."""
    if settings.database:
        return settings.database
    try:
        return existing(settings.data_folder).log_url
    except StoreUnavailable:
        return ""
