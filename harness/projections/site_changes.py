"""Folds people's changes to a site's routes, own missions and robots; they apply to what its folder holds. Pure."""

from collections.abc import Sequence
from typing import assert_never

import msgspec
from msgspec.structs import replace

from harness.contracts.places import Route, Site
from harness.contracts.site_events import (
    RobotRemoved,
    RobotSaved,
    RouteRemoved,
    RouteSaved,
    SiteEvent,
    TemplateRemoved,
    TemplateSaved,
)
from harness.contracts.tasks import TaskTemplate
from harness.contracts.values import Count, Value
from harness.projections.places import as_changed


class ChangedRoute(Value):
    """The newest change to a route: `route` is None where it was removed."""

    route: Route | None
    revision: Count


class ChangedTemplate(Value):
    """The newest change to a mission: `template` is None, and `text` empty, where it was removed."""

    template: TaskTemplate | None
    text: str
    revision: Count


class ChangedRobot(Value):
    """The newest change to a robot: `text`, its YAML, is empty where it was removed."""

    text: str
    revision: Count


class SiteChanges(Value):
    """The fold of a site's changes, by the names of routes, missions and robots."""

    version: Count = 0
    routes: dict[str, ChangedRoute] = msgspec.field(default_factory=dict)
    templates: dict[str, ChangedTemplate] = msgspec.field(default_factory=dict)
    robots: dict[str, ChangedRobot] = msgspec.field(default_factory=dict)

    def route_revision(self, name: str) -> int:
        """0 for a route that nobody changed."""
        change = self.routes.get(name)
        return change.revision if change is not None else 0

    def template_revision(self, name: str) -> int:
        """0 for a mission that nobody changed."""
        change = self.templates.get(name)
        return change.revision if change is not None else 0

    def robot_revision(self, name: str) -> int:
        """0 for a robot that nobody changed."""
        change = self.robots.get(name)
        return change.revision if change is not None else 0


def apply(changes: SiteChanges, event: SiteEvent) -> SiteChanges:
    """The changes after one more event."""
    match event:
        case RouteSaved(route=route):
            return _with_route(changes, route.name, ChangedRoute(route=route, revision=event.revision))
        case RouteRemoved():
            return _with_route(changes, event.name, ChangedRoute(route=None, revision=event.revision))
        case TemplateSaved(template=template):
            change = ChangedTemplate(template=template, text=event.text, revision=event.revision)
            return _with_template(changes, template.name, change)
        case TemplateRemoved():
            change = ChangedTemplate(template=None, text="", revision=event.revision)
            return _with_template(changes, event.name, change)
        case RobotSaved():
            return _with_robot(changes, event.name, ChangedRobot(text=event.text, revision=event.revision))
        case RobotRemoved():
            return _with_robot(changes, event.name, ChangedRobot(text="", revision=event.revision))
        case _:
            assert_never(event)


def with_routes(site: Site, changes: SiteChanges) -> Site:
    """The site with its changed routes in their order, new ones after them, removed ones left out."""
    newest = {name: change.route for name, change in changes.routes.items()}
    return replace(site, routes=as_changed(site.routes, newest, lambda route: route.name))


def with_templates(shipped: Sequence[TaskTemplate], changes: SiteChanges) -> tuple[TaskTemplate, ...]:
    """The missions with their changes in their order, new ones after them, removed ones left out."""
    newest = {name: change.template for name, change in changes.templates.items()}
    return as_changed(shipped, newest, lambda template: template.name)


def _with_route(changes: SiteChanges, name: str, change: ChangedRoute) -> SiteChanges:
    return replace(changes, version=changes.version + 1, routes=changes.routes | {name: change})


def _with_template(changes: SiteChanges, name: str, change: ChangedTemplate) -> SiteChanges:
    return replace(changes, version=changes.version + 1, templates=changes.templates | {name: change})


def _with_robot(changes: SiteChanges, name: str, change: ChangedRobot) -> SiteChanges:
    return replace(changes, version=changes.version + 1, robots=changes.robots | {name: change})
