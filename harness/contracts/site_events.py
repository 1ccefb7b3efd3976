"""Changes that people make to the reference routes, the own missions and the robots of a site: every version is stored.

Missions under way keep what they were compiled with. Robots are connected when the harness starts, so that a change to
them counts from the next start.
"""

from typing import Annotated

import msgspec

from harness.contracts.actors import Actor, Command, Event
from harness.contracts.ids import StreamId
from harness.contracts.places import Route
from harness.contracts.tasks import TaskTemplate
from harness.contracts.values import Count, Name

MOST_WAYPOINTS = 1000
LONGEST_TEMPLATE, LONGEST_ROBOT = 200_000, 20_000
"""Of a mission's YAML and of a robot's entry, in characters."""
TemplateText = Annotated[str, msgspec.Meta(min_length=1, max_length=LONGEST_TEMPLATE)]
"""A mission's YAML as a person wrote it, with its comments."""
RobotText = Annotated[str, msgspec.Meta(min_length=1, max_length=LONGEST_ROBOT)]
"""The YAML of one entry of robots.yaml. It names where secrets stand and holds none."""


class RouteSaved(Event, tag=True):
    """A person added or changed a route. `revision` counts the changes to this route from 1."""

    route: Route
    revision: Count
    actor: Actor
    reason: Name
    at_s: float


class RouteRemoved(Event, tag=True):
    """New missions can no longer be planned along it."""

    name: Name
    revision: Count
    actor: Actor
    reason: Name
    at_s: float


class TemplateSaved(Event, tag=True):
    """A person added or changed a mission of the site's own. `template` is what counts, `text` how it was written."""

    template: TaskTemplate
    text: TemplateText
    revision: Count
    actor: Actor
    reason: Name
    at_s: float


class TemplateRemoved(Event, tag=True):
    """It can no longer be started."""

    name: Name
    revision: Count
    actor: Actor
    reason: Name
    at_s: float


class RobotSaved(Event, tag=True):
    """A person added or changed an entry of robots.yaml: `text` is the entry's YAML."""

    name: Name
    text: RobotText
    revision: Count
    actor: Actor
    reason: Name
    at_s: float


class RobotRemoved(Event, tag=True):
    """It is not started or connected any more."""

    name: Name
    revision: Count
    actor: Actor
    reason: Name
    at_s: float


class SaveRoute(Command, tag=True):
    """Save a route. `basis`: the revision that the person saw, 0 for a new route or one as shipped."""

    route: Route
    basis: Count
    actor: Actor
    reason: Name


class RemoveRoute(Command, tag=True):
    name: Name
    basis: Count
    actor: Actor
    reason: Name


class SaveTemplate(Command, tag=True):
    """Save a mission of the site's own, as its YAML says it."""

    template: TaskTemplate
    text: TemplateText
    basis: Count
    actor: Actor
    reason: Name


class RemoveTemplate(Command, tag=True):
    name: Name
    basis: Count
    actor: Actor
    reason: Name


class SaveRobot(Command, tag=True):
    """Save an entry of robots.yaml, as its YAML says it."""

    name: Name
    text: RobotText
    basis: Count
    actor: Actor
    reason: Name


class RemoveRobot(Command, tag=True):
    name: Name
    basis: Count
    actor: Actor
    reason: Name


SiteEvent = RouteSaved | RouteRemoved | TemplateSaved | TemplateRemoved | RobotSaved | RobotRemoved
SiteRemoval = RemoveRoute | RemoveTemplate | RemoveRobot
SiteCommand = SaveRoute | RemoveRoute | SaveTemplate | RemoveTemplate | SaveRobot | RemoveRobot


def site_stream(site: str) -> StreamId:
    return StreamId(f"site/{site}")
