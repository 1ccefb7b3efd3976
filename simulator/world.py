"""Advances the simulated world tick by tick: body, sensors, invocations, faults, truth. Its clock is mission time."""

import math
from collections.abc import Sequence
from pathlib import Path

from harness.contracts.ids import MissionId, RequestId
from harness.contracts.observations import Image
from harness.contracts.reasons import because
from harness.contracts.regularities import HiddenSite, Regularity
from harness.contracts.simulation import Fidelity
from harness.contracts.values import Point, Value
from simulator import bodies, fidelities
from simulator.camera import CAMERA
from simulator.disturbances import Disturbances
from simulator.faults import Fault, FaultPlan
from simulator.invocations import RunningSkill
from simulator.journals import SavedWorld, load_world, save_world
from simulator.navigation import RouteFollower
from simulator.noise import Streams
from simulator.obstruction import boxes_across
from simulator.picture_cache import photograph, photograph_nearby
from simulator.pose_estimate import Estimate
from simulator.routes import RouteLine
from simulator.samples import SampleRing, SensorBlobs
from simulator.site import START, TROLLEY, storage_site
from simulator.skill_interface import Outcome, Perception, Shot, Step
from simulator.solids import SiteModel
from simulator.truth import Truth, TruthKind, TruthLog

EPOCH_S = 1_790_000_000.0
MOVING_TICKS = 4
STANDING_TICKS = 20
EARLY_CLAIM_M = 0.14


class WorldSettings(Value):
    """How to build a world. `epoch_s` is its first mission time, unless a saved world has reached a later one.

    `hidden` are the recurring disturbances of its site; without it a robot starts a mission where the last one ended.
    `pictures` is a folder in which the processes of a suite share the pictures that they render.
    """

    fidelity: Fidelity = "kinematic"
    seed: int = 0
    epoch_s: float = EPOCH_S
    hidden: HiddenSite | None = None
    pictures: str = ""


class World:
    """One robot in one site. Only `tick` lets time pass."""

    def __init__(self, settings: WorldSettings, folder: Path | None, *, name: str = "") -> None:
        self._settings, self._folder, self._name = settings, folder, name
        self._file = folder and folder / "world.json"
        saved = load_world(self._file) if self._file else None
        pose = saved.pose if saved else START
        self._home: SiteModel = storage_site()
        self.site: SiteModel = self._home
        state = bodies.BodyState(x_m=pose[0], y_m=pose[1], yaw_rad=pose[2])
        self.ring = SampleRing(saved.seq if saved else 0)
        believed = saved.believed or pose if saved else pose
        embodiment = fidelities.embodiment(
            settings.fidelity,
            self.site,
            state,
            ring=self.ring,
            streams=Streams(settings.seed),
            stance=saved.stance if saved else (),
            began=believed,
        )
        self.body, self.sensors = embodiment.body, embodiment.sensors
        self.blobs = SensorBlobs(folder and folder / "blobs")
        self.truth = TruthLog(folder and folder / "truth")
        self.faults = FaultPlan(None, (), began_s=0.0)
        self._disturbances: Disturbances | None = None
        self._standing: tuple[Regularity, ...] = ()
        self.hardware_stop = False
        self.reached_m: dict[str, float] = dict(saved.reached_m) if saved else {}
        self._epoch_s = max(saved.at_s, settings.epoch_s) if saved else settings.epoch_s
        self._ticks = 0
        self._command = bodies.Velocity()
        self.at_s = self._epoch_s
        """Mission time, seconds since the Unix epoch."""
        if saved:
            self.sensors.odometer, self.sensors.charge = saved.odometer, saved.charge
        self._estimate = Estimate(believed)
        self._estimate.begin(self.sensors.odometer)

    @property
    def still(self) -> bool:
        """Whether the robot's own sensors show that it stands still."""
        return self.sensors.still

    @property
    def believed(self) -> Point:
        """The pose estimate of the robot's controller."""
        return (self._estimate.x_m, self._estimate.y_m)

    def configure(self, mission_id: MissionId, seed: int, faults: Sequence[Fault]) -> None:
        """Begin a mission: its own random streams, faults and truth file, and the site as it is without faults.

        The mission that is under way goes on as it was: its supervisor came back.
        """
        if mission_id == self.faults.mission_id:
            return
        self.faults = FaultPlan(mission_id, faults, began_s=self.at_s)
        self.sensors.reseed(Streams(seed))
        self._furnish(self._home.with_solids(TROLLEY) if self.faults.hides_passage else self._home)
        if self._settings.hidden is not None:
            self._disturbances = Disturbances(self._settings.hidden.regularities, seed=seed, began_s=self.at_s)
            self._carry_back()
        self.truth.begin(mission_id)
        self.note("mission", text=f"{mission_id} seed {seed}")

    def clear_way(self) -> None:
        """Somebody came: took away what a fault had put in the way, and set a fallen robot on its feet."""
        self.faults.forget_obstacles()
        self._furnish(self._home)
        if self.body.state.fallen:
            self.body.set_on_feet()

    def invocation_starts(self, invocation: RunningSkill, node: str) -> None:
        """A skill was accepted and begins with the next tick."""
        skill = invocation.skill
        identity = invocation.request.identity
        self.note("start", request_id=identity.request_id, text=identity.provider_id)
        self.faults.invocation_starts(identity.mission_id, navigates=isinstance(skill, RouteFollower))
        if isinstance(skill, RouteFollower):
            self.reached_m[node] = skill.at_m
            if self.site is self._home and self.faults.strikes("blocked-passage"):
                at_m = float(round(skill.begin_m + 0.5 * skill.remaining_m))
                gap = not self.faults.persistent("blocked-passage")
                boxes = boxes_across(self._home, skill.route, at_m, gap=gap)
                self._furnish(self._home.with_solids(*boxes))
            if self.site is self._home and self._disturbances is not None:
                self._obstruct(self._disturbances, skill.route)

    def invocation_ended(self, invocation: RunningSkill, node: str) -> None:
        """A skill is terminal: its progress is remembered and the world saved."""
        report = invocation.report()
        self.note("terminal", request_id=report.identity.request_id, text=f"{report.status} {report.failure}".strip())
        if isinstance(invocation.skill, RouteFollower):
            self.reached_m[node] = invocation.skill.at_m
            self.faults.navigation_ends(self.at_s)
            struck = "blocked-passage" in self.faults.struck and not self.faults.persistent("blocked-passage")
            if struck and report.status == "succeeded":
                self._furnish(self._home)
        hidden = self.faults.hides_passage and not self.faults.persistent("hidden-passage")
        if hidden and invocation.card.capability == "capture_panorama":
            self._furnish(self._home)
        self.save(durable=True)

    def tick(self, invocations: Sequence[RunningSkill]) -> None:
        """TICK_S of mission time: skills decide, the body moves, sensors read."""
        sensors = self.sensors
        sensors.mode = self.faults.mode(self.at_s)
        if self._disturbances is not None:
            self._live_with(self._disturbances)
        coarse = self._settings.fidelity == "kinematic" and self._ticks % 2 == 1
        if not (coarse and invocations and all(one.cruising for one in invocations)):
            self._command = self._decided(invocations)
        self.body.step(bodies.Velocity() if self.hardware_stop else self._command)
        if self.body.state.fallen:
            self._fall(invocations)
        self._ticks += 1
        at_s = self.at_s = self._epoch_s + self._ticks * bodies.TICK_S
        state = self.body.state
        sensors.sample(state, at_s)
        if sensors.scan_due:
            sensors.scan(self.body.cloud(), at_s, self.blobs.keep)
        self._estimate.update(sensors.odometer, sensors.fix)
        if self.faults.untold:
            self._tell_struck()
        if self._ticks % MOVING_TICKS == 0:
            still = state.still
            if not still or self._ticks % STANDING_TICKS == 0:
                self.note("pose")
            if not still:
                self.save(durable=False)

    def _decided(self, invocations: Sequence[RunningSkill]) -> bodies.Velocity:
        """The velocity that the skills want now. At kinematic fidelity a cruising skill is run every second tick."""
        command = bodies.Velocity()
        if not invocations:
            return command
        perception = self._perception()
        for invocation in invocations:
            velocity = invocation.tick(perception)
            if invocation.card.moves:
                command = velocity
            if self.faults.strikes_motion:
                self._strike(invocation)
            if self._disturbances is not None and self._hindered(self._disturbances, invocation):
                command = bodies.Velocity()
        return command

    def _fall(self, invocations: Sequence[RunningSkill]) -> None:
        """What moved the body ends as failed: it has fallen, and nothing that it does moves it on."""
        self._command = bodies.Velocity()
        for invocation in invocations:
            if invocation.card.moves and not invocation.terminal and not invocation.braking:
                self.note("fell", request_id=invocation.request.identity.request_id)
                invocation.brake_for(
                    Step(outcome=Outcome(status="failed", failure="fallen", message=because("robot_fallen")))
                )

    def note(self, kind: TruthKind, **facts: str) -> None:
        """Write one line of ground truth."""
        state = self.body.state
        x, y, yaw = state.x_m, state.y_m, state.yaw_rad
        self.truth.add(Truth(kind=kind, at_s=self.at_s, x_m=x, y_m=y, yaw_rad=yaw, v_mps=state.v_mps, **facts))

    def save(self, *, durable: bool) -> None:
        """Write clock, body and counters, if there is a folder."""
        if self._file is not None:
            state = self.body.state
            world = SavedWorld(
                at_s=self.at_s,
                seq=self.ring.newest,
                pose=(state.x_m, state.y_m, state.yaw_rad),
                odometer=self.sensors.odometer,
                charge=self.sensors.charge,
                reached_m=self.reached_m,
                stance=self.body.stance,
                believed=(self._estimate.x_m, self._estimate.y_m, self._estimate.yaw_rad),
            )
            save_world(self._file, world, durable=durable)

    def _strike(self, invocation: RunningSkill) -> None:
        """Applies the mission's faults to a navigation that is under way."""
        skill = invocation.skill
        if invocation.terminal or invocation.braking or not isinstance(skill, RouteFollower):
            return
        whole_m = max(skill.route.length_m - skill.begin_m, 1e-6)
        share, remaining_m = (skill.at_m - skill.begin_m) / whole_m, skill.remaining_m
        self.faults.navigation_moves(share=share, remaining_m=remaining_m)
        if self.body.can_fall and self.faults.pushes(share):
            self.body.push_over()
        if self.faults.ends_early(remaining_m):
            invocation.brake_for(skill.claim(self.at_s, distance_m=EARLY_CLAIM_M))
        elif self.faults.interrupts(share, invocation.card.provider_id):
            words = Outcome(status="failed", failure="interrupted", message=because("controller_interrupted"))
            invocation.brake_for(Step(outcome=words))

    def _live_with(self, disturbances: Disturbances) -> None:
        """Applies the site's effect on the localiser, and removes an obstacle whose time is over."""
        state = self.body.state
        disturbances.pass_by((state.x_m, state.y_m), self.at_s)
        if disturbances.moods and self.sensors.mode == "good":
            self.sensors.mode = disturbances.mode(self.at_s)
        if self._standing and disturbances.in_the_way(self.at_s) != self._standing:
            self._standing = ()
            self._furnish(self._home)

    def _obstruct(self, disturbances: Disturbances, route: RouteLine) -> None:
        """Set up the obstacles across this route."""
        standing = tuple(
            one
            for one in disturbances.in_the_way(self.at_s)
            if math.dist(one.at_m, _nearest(route, one.at_m)) <= one.radius_m
        )
        solids = [
            solid
            for one in standing
            for solid in boxes_across(self._home, route, route.nearest(*one.at_m), gap=one.kind == "obstructed")
        ]
        if solids:
            self._standing = disturbances.in_the_way(self.at_s)
            self._furnish(self._home.with_solids(*solids))

    def _hindered(self, disturbances: Disturbances, invocation: RunningSkill) -> bool:
        """Applies the site's effect on a passing navigation; whether it has to stand there without a report."""
        skill, provider_id = invocation.skill, invocation.card.provider_id
        if not isinstance(skill, RouteFollower) or invocation.terminal or invocation.braking:
            return False
        if disturbances.holds("claiming", provider_id, self.at_s):
            invocation.brake_for(skill.claim(self.at_s, distance_m=EARLY_CLAIM_M))
        elif disturbances.holds("giving_up", provider_id, self.at_s):
            words = Outcome(status="failed", failure="interrupted", message=because("controller_interrupted"))
            invocation.brake_for(Step(outcome=words))
        elif disturbances.holds("stalling", provider_id, self.at_s):
            skill.resume(self.at_s)
            return True
        return False

    def carry(self, pose: tuple[float, float, float]) -> None:
        """A person sets the robot down at a pose (m, rad): neither odometry nor localiser counts it as motion."""
        state = self.body.state
        state.x_m, state.y_m, state.yaw_rad = pose
        state.v_mps = state.w_radps = state.sway_mps = 0.0
        self._command = bodies.Velocity()
        self.body.furnish(self.site)
        self.sensors.put_down()
        self._estimate = Estimate(pose)
        self._estimate.begin(self.sensors.odometer)

    def _carry_back(self) -> None:
        """To where it starts, with nothing left in its way."""
        self._standing = ()
        self.carry(START)

    def _tell_struck(self) -> None:
        """Writes a line of ground truth with the counts of all faults so far."""
        self.faults.untold = False
        self.note("struck", text=" ".join(f"{name}={count}" for name, count in sorted(self.faults.struck.items())))

    def _furnish(self, site: SiteModel) -> None:
        if site is not self.site:
            self.site = site
            self.body.furnish(site)

    def _perception(self) -> Perception:
        estimate = self._estimate
        return Perception(
            at_s=self.at_s,
            x_m=estimate.x_m,
            y_m=estimate.y_m,
            yaw_rad=estimate.yaw_rad,
            still=self.still,
            ranges=self.body.ranges,
            capture=self._capture,
            keep=self.blobs.keep,
            frame=self.site.frame,
            map_version=self.site.map_version,
        )

    def _capture(self, heading_rad: float, request: RequestId) -> Shot:
        state = self.body.state
        pose, key = (state.x_m, state.y_m, state.yaw_rad), f"{self._name}\n{self.sensors.seed}\n{self.at_s!r}"
        if self._settings.fidelity == "kinematic":
            picture = photograph_nearby(self.site, pose, key=key, folder=self._settings.pictures)
        else:
            picture = photograph(self.site, pose, key=key, tilt=state.tilt)
        blob = self.blobs.keep_image(picture)
        image = Image(
            seq=self.ring.next(),
            at_s=self.at_s,
            source="camera",
            frame="camera",
            blob=blob,
            media_type="image/jpeg",
            width_px=CAMERA.width_px,
            height_px=CAMERA.height_px,
            yaw_rad=heading_rad,
            request_id=request,
        )
        self.ring.add(image)
        return Shot(blob=blob, seq=image.seq, at_s=image.at_s)


def _nearest(route: RouteLine, point: Point) -> Point:
    return route.point(route.nearest(*point))
