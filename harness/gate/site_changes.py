"""Decides whether a route, an own mission or a robot of a site may be saved or removed; the person must have seen its
current revision. Pure.

What each of them must be at this site is checked before, where its map, its places and its files are known.
"""

from itertools import chain
from math import isfinite
from typing import TypeVar, assert_never

from harness.contracts import site_events
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.places import Route
from harness.contracts.reasons import because
from harness.contracts.values import Moment
from harness.gate.places import FARTHEST_M, stale_basis
from harness.projections.site_changes import SiteChanges, apply

Removed = TypeVar("Removed", site_events.RouteRemoved, site_events.TemplateRemoved, site_events.RobotRemoved)


def decide(changes: SiteChanges, command: site_events.SiteCommand, now: Moment) -> Decision[site_events.SiteEvent]:
    """Refuse a change based on an older revision, and a route with impossible positions."""
    match command:
        case site_events.SaveRoute(route=route):
            revision = changes.route_revision(route.name)
            return (
                stale_basis(revision, command.basis, route.name)
                or _nowhere(route)
                or Accepted(
                    (
                        site_events.RouteSaved(
                            route=route,
                            revision=revision + 1,
                            actor=command.actor,
                            reason=command.reason,
                            at_s=now.wall_s,
                        ),
                    )
                )
            )
        case site_events.RemoveRoute(name=name):
            return _removed(site_events.RouteRemoved, command, changes.route_revision(name), now)
        case site_events.SaveTemplate(template=template):
            revision = changes.template_revision(template.name)
            return stale_basis(revision, command.basis, template.name) or Accepted(
                (
                    site_events.TemplateSaved(
                        template=template,
                        text=command.text,
                        revision=revision + 1,
                        actor=command.actor,
                        reason=command.reason,
                        at_s=now.wall_s,
                    ),
                )
            )
        case site_events.RemoveTemplate(name=name):
            return _removed(site_events.TemplateRemoved, command, changes.template_revision(name), now)
        case site_events.SaveRobot(name=name):
            revision = changes.robot_revision(name)
            return stale_basis(revision, command.basis, name) or Accepted(
                (
                    site_events.RobotSaved(
                        name=name,
                        text=command.text,
                        revision=revision + 1,
                        actor=command.actor,
                        reason=command.reason,
                        at_s=now.wall_s,
                    ),
                )
            )
        case site_events.RemoveRobot(name=name):
            return _removed(site_events.RobotRemoved, command, changes.robot_revision(name), now)
        case _:
            assert_never(command)


def _removed(
    kind: type[Removed], command: site_events.SiteRemoval, revision: int, now: Moment
) -> Decision[site_events.SiteEvent]:
    return stale_basis(revision, command.basis, command.name) or Accepted(
        (
            kind(
                name=command.name,
                revision=revision + 1,
                actor=command.actor,
                reason=command.reason,
                at_s=now.wall_s,
            ),
        )
    )


def _nowhere(route: Route) -> Refused | None:
    if not 2 <= len(route.waypoints_m) <= site_events.MOST_WAYPOINTS:
        return refused("route_size", because("route_size_invalid", most=site_events.MOST_WAYPOINTS))
    if not all(isfinite(value) and abs(value) <= FARTHEST_M for value in chain.from_iterable(route.waypoints_m)):
        return refused("nowhere", because("place_nowhere", limit_km=FARTHEST_M / 1000))
    return None


DECIDER: Decider[SiteChanges, site_events.SiteCommand, site_events.SiteEvent] = Decider(
    initial=SiteChanges(), apply=apply, decide=decide, codec=Codec(site_events.SiteEvent)
)
