#!/usr/bin/env python3
"""Puts a ROS 2 robot with Nav2's NavigateToPose behind the provider protocol: one file, rclpy and message packages.

It runs on the robot, in the robot's own distribution (Humble, Jazzy) and middleware, and imports nothing of the
harness. It keeps the robot safe by itself: without keepalives it cancels the goal, it reports `cancelled` only at a
standstill that odometry shows, it refuses old fencing tokens, and every start is on disk before a goal is sent.

ROBOT_TOKEN=SECRET python3 ros2_sidecar.py --name robot-1 --map-version shop-1 --port 8765
ROBOT_TOKEN=SECRET python3 ros2_sidecar.py --name robot-1 --map-version shop-1 --port 8766 --observe

With --observe it is a second path for evidence: the same topics, read by a process that offers no provider and
declares nothing. For a robot in shadow mode it is all there is: it hands on what the robot's own action server was
given by others and how that says it ended, and has no way to send it anything.
"""

import argparse
import array
import base64
import collections
import contextlib
import functools
import hashlib
import json
import math
import os
import pathlib
import secrets
import sys
import threading
import time
import uuid
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import rclpy
from action_msgs.msg import GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav2_msgs.action import NavigateToPose
from nav2_msgs.msg import SpeedLimit
from nav_msgs.msg import Odometry, Path
from rclpy.action import ActionClient
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import BatteryState, CompressedImage, Imu, LaserScan
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage

PERIOD_S = 0.05  # the control loop
KEEPALIVE_S = 1.3  # without one for so long the goal is cancelled: the body must stand within 2 s
CANCEL_AGAIN_S = 0.3
REST_S, REST_M, REST_RAD = 0.6, 0.01, 0.02  # standstill: so little motion by odometry for so long
FRESH_S = 1.0  # an older pose, or an older correction by the localiser, is none
AHEAD_S = 0.5  # a stamp further ahead of the robot's clock is wrong
ANSWER_S = 5.0  # an action server that takes longer to answer a goal is lost
SENSE_S, SCAN_S = 0.04, 0.5  # at most so often a sample of each kind
KEPT_SAMPLES, KEPT_BLOBS, KEPT_CHANGES, KEPT_GOALS = 20_000, 400, 1000, 200
LOOK_S, LOST_S = 0.5, 5.0  # an action server that is out of the ROS graph for so long does not end its goals any more
TOLD_S, OFF_M = 2.0, 0.5  # a goal follows its pose on a topic within so long, and its plan ends so near to that
BODY_BYTES = 1 << 20
SAYS = {
    GoalStatus.STATUS_SUCCEEDED: "succeeded",
    GoalStatus.STATUS_CANCELED: "cancelled",
    GoalStatus.STATUS_ABORTED: "failed",
}
ENDS = {GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED}
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE)
STATIC = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE)


def card_of(given):
    """What this robot offers: one capability, with the bounds that its own stack has."""
    return {
        "provider_id": "navigate_to_pose",
        "version": given.version,
        "capability": "navigate",
        "embodiments": [given.embodiment],
        "parameters": [
            {"name": "target", "type": "point", "unit": "m"},
            {"name": "frame", "type": "frame"},
            {"name": "tolerance_m", "type": "number", "unit": "m", "minimum": given.goal_tolerance, "maximum": 5.0},
            {"name": "speed_cap_mps", "type": "number", "unit": "m/s", "minimum": 0.05, "maximum": given.max_speed},
        ],
        "preconditions": ["localised"],
        "side_effects": ["moves the robot"],
        "latency": {"base_s": 3.0, "per_metre_s": 1.5 / given.max_speed},
        "resources": ["mobile_base"],
        "cancel": {"acknowledged": True, "within_s": given.stops_within},
        "risk": "medium",
        "failure_words": [
            "timeout",
            "rejected",
            "aborted",
            "cancelled_elsewhere",
            "server_lost",
            "restarted",
            "emergency_stop",
        ],
        "evidence": ["pose", "odometry"] + (["scan"] if given.scan_topic else []),
        "estimates": {"success": 0.9, "risk": 0.1, "uncertainty": 0.1, "cost": 1.0},
        "moves": True,
        "sources": ["localiser", "odometry", "lidar"],
        "reattach": "by_request",
        "resumable": True,
        "software": f"ros2_sidecar.py on {given.action}",
        "protocol": "1.1",
    }


class Refusal(Exception):
    """An answer that is not 200: what happened, and what can be done about it."""

    def __init__(self, status, code, what, do):
        super().__init__(what)
        self.status, self.problem = status, {"code": code, "what": what, "where": "robot", "do": do}


def refused(what, do):
    return Refusal(409, "provider_failed", what, do)


def seconds(stamp):
    return stamp.sec + stamp.nanosec * 1e-9


def yaw_of(q):
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))


def rotated(q, v):
    """The vector `v` turned by the quaternion `q` (x, y, z, w)."""
    x, y, z, w = q
    tx, ty, tz = (2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0]))
    return (
        v[0] + w * tx + y * tz - z * ty,
        v[1] + w * ty + z * tx - x * tz,
        v[2] + w * tz + x * ty - y * tx,
    )


class Frames:
    """The newest transform of every frame to its parent, as /tf and /tf_static give them."""

    def __init__(self):
        self.links = {}  # child -> (parent, stamp or None where static, translation, quaternion)

    def take(self, message, static):
        for one in message.transforms:
            t, q = one.transform.translation, one.transform.rotation
            stamp = None if static else seconds(one.header.stamp)
            parent, child = one.header.frame_id.lstrip("/"), one.child_frame_id.lstrip("/")
            known = self.links.get(child)
            if static or known is None or known[0] != parent or known[1] is None or stamp > known[1]:
                self.links[child] = (parent, stamp, (t.x, t.y, t.z), (q.x, q.y, q.z, q.w))

    def chain(self, frame, child):
        """The links from `child` up to `frame`, or None where one is missing."""
        found = []
        while child != frame:
            link = self.links.get(child)
            if link is None or len(found) > 30:
                return None
            found.append(link)
            child = link[0]
        return found

    @staticmethod
    def moved(chain, point):
        """A point of the child frame in the frame that the chain leads to."""
        for _, _, t, q in chain:
            turned = rotated(q, point)
            point = (turned[0] + t[0], turned[1] + t[1], turned[2] + t[2])
        return point


class Senses:
    """What the robot's topics say, as samples with the stamps of their headers. Nothing here moves anything."""

    def __init__(self, node, given):
        self.node, self.given, self.lock = node, given, threading.RLock()
        self.frames, self.samples, self.blobs = Frames(), collections.deque(maxlen=KEPT_SAMPLES), {}
        self.seq = int(time.time() * 1000)  # rises over a restart of this program too
        self.pose, self.spread_m, self.charge, self.picture = None, None, 0.0, None
        self.engaged = not given.no_stop_topic  # until the topic says that the emergency stop is released
        self.track = collections.deque(maxlen=400)  # odometry: (stamp, x, y, yaw)
        self.newest, self.warned = {}, set()
        topics = [
            ("/tf", TFMessage, QoSProfile(depth=100), lambda m: self.transforms(m, False)),
            ("/tf_static", TFMessage, STATIC, lambda m: self.transforms(m, True)),
            (given.pose_topic, PoseWithCovarianceStamped, qos_profile_sensor_data, self.on_pose),
            (given.pose_topic, PoseWithCovarianceStamped, LATCHED, self.on_pose),
            (given.odom_topic, Odometry, qos_profile_sensor_data, self.on_odometry),
            (given.scan_topic, LaserScan, qos_profile_sensor_data, self.on_scan),
            (given.imu_topic, Imu, qos_profile_sensor_data, self.on_imu),
            (given.battery_topic, BatteryState, qos_profile_sensor_data, self.on_battery),
            (given.image_topic, CompressedImage, qos_profile_sensor_data, self.on_image),
        ]
        if not given.no_stop_topic:
            topics += [(given.stop_topic, Bool, qos, self.on_stop) for qos in (qos_profile_sensor_data, LATCHED)]
        for name, kind, qos, heard in topics:
            if name:
                node.create_subscription(kind, name, functools.partial(self.locked, heard), qos)

    def locked(self, heard, message):
        with self.lock:
            heard(message)

    def now(self):
        return self.node.get_clock().now().nanoseconds * 1e-9

    def fresh(self, kind, at, every=SENSE_S):
        """Whether a sample of this stamp is to be kept: not a repeat, not too soon, not from the future."""
        if at > self.now() + AHEAD_S:
            if kind not in self.warned:
                self.node.get_logger().warning(f"{kind}: stamps are ahead of this robot's clock; they are left out")
                self.warned.add(kind)
            return False
        last = self.newest.get(kind)
        if last is not None and last - every < at < last + every:
            return False
        self.newest[kind] = at
        return True

    def keep(self, kind, at, source, **values):
        numbers = [value for value in values.values() if isinstance(value, float)]
        if all(map(math.isfinite, numbers)):
            self.seq += 1
            self.samples.append({"kind": kind, "seq": self.seq, "at_s": at, "source": source, **values})

    def store(self, body):
        digest = hashlib.sha256(body).hexdigest()
        self.blobs[digest] = body
        while len(self.blobs) > KEPT_BLOBS:
            del self.blobs[next(iter(self.blobs))]
        return digest

    def transforms(self, message, static):
        self.frames.take(message, static)
        if not static:
            self.locate()

    def locate(self):
        """The body in the map, at the stamp of the link that moves it, while the localiser's correction is fresh."""
        chain = self.frames.chain(self.given.frame, self.given.base_frame)
        stamps = [one[1] for one in chain or () if one[1] is not None]
        if not stamps or min(stamps) < self.now() - FRESH_S or self.spread_m is None:
            return
        if not self.fresh("pose", stamps[0]):
            return
        x, y, _ = self.frames.moved(chain, (0.0, 0.0, 0.0))
        ahead = self.frames.moved(chain, (1.0, 0.0, 0.0))
        yaw = math.atan2(ahead[1] - y, ahead[0] - x)
        self.pose = (stamps[0], x, y, yaw)
        confidence = 1.0 / (1.0 + (self.spread_m / self.given.localised_within) ** 2)
        where = {"x_m": x, "y_m": y, "yaw_rad": yaw, "confidence": confidence}
        self.keep("pose", stamps[0], "localiser", frame=self.given.frame, map_version=self.given.map_version, **where)

    def on_pose(self, message):
        """The localiser's own uncertainty; where the body is comes from tf, which it corrects."""
        spread = max(message.pose.covariance[0], message.pose.covariance[7])
        self.spread_m = math.sqrt(spread) if math.isfinite(spread) and spread >= 0.0 else None

    def on_odometry(self, message):
        at, p, v = seconds(message.header.stamp), message.pose.pose, message.twist.twist
        x, y, yaw = p.position.x, p.position.y, yaw_of(p.orientation)
        if not all(map(math.isfinite, (x, y, yaw, v.linear.x, v.linear.y, v.angular.z))):
            return
        self.track.append((at, x, y, yaw))
        if self.fresh("odometry", at):
            speed = math.copysign(math.hypot(v.linear.x, v.linear.y), v.linear.x)
            frame = message.header.frame_id or "odom"
            turn = v.angular.z
            self.keep("odometry", at, "odometry", frame=frame, x_m=x, y_m=y, yaw_rad=yaw, v_mps=speed, w_radps=turn)

    def on_scan(self, message):
        at = seconds(message.header.stamp)
        chain = self.frames.chain(self.given.base_frame, message.header.frame_id.lstrip("/"))
        if chain is None or not self.fresh("scan", at, SCAN_S):
            return
        points, angle = array.array("f"), message.angle_min
        for reach in message.ranges:
            if message.range_min <= reach <= message.range_max:
                points.extend(self.frames.moved(chain, (reach * math.cos(angle), reach * math.sin(angle), 0.0)))
            angle += message.angle_increment
        if sys.byteorder == "big":
            points.byteswap()
        blob = self.store(points.tobytes())
        self.keep("scan", at, "lidar", frame="body", blob=blob, points=len(points) // 3)

    def on_imu(self, message):
        at, a = seconds(message.header.stamp), message.linear_acceleration
        if self.fresh("imu", at):
            turn = message.angular_velocity.z
            self.keep("imu", at, "imu", ax_mps2=a.x, ay_mps2=a.y, w_radps=turn)

    def on_battery(self, message):
        at, charge = seconds(message.header.stamp), message.percentage
        if 0.0 <= charge <= 1.0 and self.fresh("battery", at, 1.0):
            self.charge = charge
            self.keep("battery", at, "battery", charge=charge)

    def on_stop(self, message):
        self.engaged = bool(message.data)

    def on_image(self, message):
        body = bytes(message.data)
        if (size := jpeg_size(body)) is not None:
            self.picture = (seconds(message.header.stamp), *size, body)

    def standing(self):
        """Whether fresh odometry shows a standstill over the last REST_S."""
        with self.lock:
            now = self.now()
            late = [one for one in self.track if one[0] >= now - FRESH_S]
            if not late or late[-1][0] < now - FRESH_S / 2:
                return False
            window = [one for one in late if one[0] >= late[-1][0] - REST_S]
            if len(window) < 3 or window[-1][0] - window[0][0] < REST_S * 0.8:
                return False
            _, x, y, yaw = window[-1]
            moved = max(math.hypot(one[1] - x, one[2] - y) for one in window)
            turned = max(abs(math.remainder(one[3] - yaw, math.tau)) for one in window)
            return moved < REST_M and turned < REST_RAD

    def pose_age(self):
        return None if self.pose is None else self.now() - self.pose[0]

    def localised(self):
        age = self.pose_age()
        known = self.spread_m is not None and self.spread_m <= self.given.localised_within
        return known and age is not None and -AHEAD_S < age <= FRESH_S


def jpeg_size(body):
    """Width and height by the frame header of a JPEG; None for anything else."""
    at = 2
    while body[:2] == b"\xff\xd8" and at + 9 <= len(body) and body[at] == 0xFF:
        if 0xC0 <= body[at + 1] <= 0xC3:
            return int.from_bytes(body[at + 7 : at + 9], "big"), int.from_bytes(body[at + 5 : at + 7], "big")
        at += 2 + int.from_bytes(body[at + 2 : at + 4], "big")
    return None


class StackGoals:
    """What the robot's own action server was given, by whomever, and how it says that ended. It only listens.

    The status topic names goals and says how they end, never where they lead: no topic of an action does. That is read
    where the planner's newest path ends, or from the topic that a goal was given by; where both contradict each other,
    or more goals than one are open, a goal has no target.
    """

    def __init__(self, node, given):
        self.node, self.given, self.lock = node, given, threading.RLock()
        self.run = uuid.uuid4().hex  # another one after each start: numbers begin anew
        self.begun = self.now()
        self.changes, self.goals, self.seq = [], {}, 0
        self.plan = self.told = None  # (stamp, frame, x, y)
        self.alone = 0.0  # since when no other goal is open
        self.status_topic = f"{given.action}/_action/status"
        feedback = NavigateToPose.Impl.FeedbackMessage
        for kind, name, heard, qos in (
            (GoalStatusArray, self.status_topic, self.on_status, LATCHED),
            (feedback, f"{given.action}/_action/feedback", self.on_feedback, QoSProfile(depth=10)),
            (Path, given.plan_topic, self.on_plan, QoSProfile(depth=5)),
            (PoseStamped, given.goal_topic, self.on_told, QoSProfile(depth=5)),
        ):
            if name:
                node.create_subscription(kind, name, functools.partial(self.locked, heard), qos)
        node.create_timer(LOOK_S, self.look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def locked(self, heard, message):
        with self.lock:
            heard(message)

    def now(self):
        return self.node.get_clock().now().nanoseconds * 1e-9

    @property
    def open(self):
        return [one for one in self.goals.values() if one["status"] == "active"]

    def say(self, goal, status, at, text=""):
        """One more change. A goal that is over stays over."""
        goal["status"], self.seq = status, self.seq + 1
        change = {"seq": self.seq, "goal_id": goal["id"], "at_s": at, "status": status, "text": text}
        if goal["target"] is not None:
            frame, x, y = goal["target"]
            change |= {"target_m": [x, y], "frame": frame, "map_version": self.given.map_version}
        self.changes.append(change)
        del self.changes[:-KEPT_CHANGES]
        if status != "active":
            self.alone = self.now()

    def on_status(self, message):
        """Every goal that the server still knows. One that it forgot without a word has no end that anybody knows."""
        now, named = self.now(), set()
        for one in message.status_list:
            key = bytes(one.goal_info.goal_id.uuid).hex()
            named.add(key)
            goal, accepted = self.goals.get(key), min(now, seconds(one.goal_info.stamp))
            if goal is None:
                if one.status in SAYS and accepted < self.begun:
                    continue  # it was over before anybody listened
                goal = self.take(key, accepted)
            if one.status in SAYS and goal["status"] == "active":
                left = "" if goal["left"] is None else f", {goal['left']:.2f} m left by its feedback"
                self.say(goal, SAYS[one.status], now, f"{self.given.action} says {SAYS[one.status]}{left}")
        for goal in self.open:
            if goal["id"] not in named:
                self.say(goal, "unknown", now, f"{self.given.action} names it no more")

    def take(self, key, accepted):
        goal = {"id": key, "accepted": accepted, "target": None, "told": None, "left": None}
        goal |= {"status": "active", "servers": self.servers(), "gone": None}
        self.goals[key] = goal
        for old in list(self.goals)[:-KEPT_GOALS]:
            if self.goals[old]["status"] != "active":
                del self.goals[old]
        if self.told is not None and accepted - TOLD_S <= self.told[0] <= accepted:
            goal["told"], self.told = self.told[1:], None
        self.say(goal, "active", accepted)
        self.aim()
        return goal

    def on_feedback(self, message):
        goal, left = self.goals.get(bytes(message.goal_id.uuid).hex()), message.feedback.distance_remaining
        if goal is not None and math.isfinite(left):
            goal["left"] = left

    def on_plan(self, message):
        if message.poses:
            last = message.poses[-1]
            self.plan = self.point(message.header.stamp, message.header.frame_id or last.header.frame_id, last.pose)
            self.aim()

    def on_told(self, message):
        self.told = self.point(message.header.stamp, message.header.frame_id, message.pose)

    @staticmethod
    def point(stamp, frame, pose):
        x, y = pose.position.x, pose.position.y
        return (seconds(stamp), frame.lstrip("/"), x, y) if math.isfinite(x) and math.isfinite(y) else None

    def aim(self):
        """Where the only open goal leads to: a plan counts that was made since it was accepted, and it was alone."""
        if len(self.open) != 1:
            return
        (goal,) = self.open
        plan = self.plan is not None and self.plan[0] >= max(goal["accepted"], self.alone) and self.plan[1:]
        target = goal["told"] or plan or goal["target"]
        if goal["told"] and plan and (plan[0] != target[0] or math.dist(plan[1:], target[1:]) > OFF_M):
            target = None  # what it was told, and where it goes, are not the same
        if target != goal["target"]:
            goal["target"] = target
            self.say(goal, "active", self.now())

    def servers(self):
        """Who publishes the status of goals, as the ROS graph names them."""
        found = self.node.get_publishers_info_by_topic(self.status_topic)
        return {bytes(one.endpoint_gid) for one in found}

    def look(self):
        """The goals of an action server that is gone, or was started anew, have no end that anybody will learn."""
        with self.lock:
            there, now = self.servers(), time.monotonic()
            for goal in self.open:
                if not goal["servers"] or goal["servers"] & there:
                    goal["servers"], goal["gone"] = goal["servers"] or there, None
                elif goal["gone"] is None:
                    goal["gone"] = now
                elif now - goal["gone"] > LOST_S:
                    self.say(goal, "unknown", self.now(), f"the server of {self.given.action} is gone")

    def after(self, after, limit):
        with self.lock:
            found = [one for one in self.changes if one["seq"] > after][: max(0, limit)]
            newest = found[-1]["seq"] if found else after
            own = {"stack": self.given.action.strip("/"), "run": self.run, "at_s": self.now()}
            return {"changes": found, "next_seq": newest, **own}


class Journal:
    """Starts and ends on disk, one JSON line each, written through before anything moves."""

    def __init__(self, path):
        path.parent.mkdir(parents=True, exist_ok=True)
        whole = path.read_bytes() if path.exists() else b""
        self.lines = [json.loads(line) for line in whole[: whole.rfind(b"\n") + 1].splitlines()]
        self.file = path.open("ab")
        self.file.truncate(whole.rfind(b"\n") + 1)  # what a crash left half written was never answered

    def write(self, line):
        self.file.write(json.dumps(line).encode() + b"\n")
        self.file.flush()
        os.fsync(self.file.fileno())
        self.lines.append(line)


class Run:
    """One execution: its request, and how its goal stands."""

    def __init__(self, request, fixed, handle, begun):
        self.request, self.fixed, self.handle, self.begun = request, fixed, handle, begun
        self.heard = self.spoke = time.monotonic()  # the last keepalive; the last word of the action server
        self.held, self.ending, self.message, self.final = False, None, "", None
        self.goal, self.open, self.sent, self.asked, self.orphan = None, False, 0, 0.0, False
        self.share, self.remaining, self.whole = 0.0, None, None

    @property
    def target(self):
        return self.request["parameters"]["target"]

    def end(self, status, failure="", message=""):
        if self.ending is None:
            self.ending, self.message = (status, failure), message


class Navigator:
    """One goal at a time of the robot's own NavigateToPose server. All that speaks ROS happens in `tick`'s thread."""

    def __init__(self, node, senses, journal, given):
        self.node, self.senses, self.journal, self.given = node, senses, journal, given
        self.card, self.lock = card_of(given), threading.RLock()
        self.client = ActionClient(node, NavigateToPose, given.action)
        self.cancel_all = node.create_client(CancelGoal, f"{given.action}/_action/cancel_goal")
        self.speed = node.create_publisher(SpeedLimit, given.speed_limit_topic, 1)
        self.requests, self.active, self.newest_token = {}, None, 0
        self.replay()
        node.create_timer(PERIOD_S, self.tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def replay(self):
        """What the journal holds. An execution that nobody saw end is cancelled, whoever runs it."""
        for line in self.journal.lines:
            if "request" in line:
                request = line["request"]
                run = Run(request, fixed_of(request), line["handle"], line["at_s"])
                run.orphan = run.open = True
                run.end("failed", "restarted", "this program was restarted under way")
                self.requests[request["identity"]["request_id"]] = self.active = run
                self.newest_token = max(self.newest_token, request["fencing"]["mobile_base"])
            else:
                run = self.requests[line["ended"]["identity"]["request_id"]]
                run.final, run.open = line["ended"], False
                self.active = None

    def tick(self):
        with self.lock:
            run, now = self.active, time.monotonic()
            if run is None:
                return
            if run.ending is None:
                if self.senses.now() >= run.request["deadline_s"]:
                    run.end("failed", "timeout", "the deadline passed")
                elif self.senses.engaged:  # or it would drive on once the stop is released
                    run.end("failed", "emergency_stop", "the emergency stop was engaged")
                elif now - run.heard > KEEPALIVE_S:
                    run.held = True
            if run.ending is not None or run.held:
                self.cancel(run, now)
            elif not run.open:
                self.send(run, now)
            elif now - run.spoke > (ANSWER_S if run.goal is None else self.given.feedback_timeout):
                run.end("failed", "server_lost", f"{self.given.action} says nothing any more")
            if run.ending is not None and not run.open and self.senses.standing():
                self.conclude(run)

    def send(self, run, now):
        """The goal, at the stamp of now, looking along the way to it."""
        if not self.client.server_is_ready():
            if now - run.spoke > ANSWER_S:
                run.end("failed", "server_lost", f"no action server on {self.given.action}")
            return
        run.open, run.goal, run.spoke, run.sent = True, None, now, run.sent + 1
        x, y = run.target
        _, bx, by, byaw = self.senses.pose
        yaw = math.atan2(y - by, x - bx) if math.hypot(x - bx, y - by) > 0.3 else byaw
        goal = NavigateToPose.Goal()
        goal.pose.header.frame_id = run.request["parameters"]["frame"]
        goal.pose.header.stamp = self.node.get_clock().now().to_msg()
        goal.pose.pose.position.x, goal.pose.pose.position.y = float(x), float(y)
        goal.pose.pose.orientation.z, goal.pose.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        self.limit(run.request["parameters"]["speed_cap_mps"])
        number = run.sent
        future = self.client.send_goal_async(goal, feedback_callback=lambda one: self.on_feedback(run, number, one))
        future.add_done_callback(lambda one: self.on_answer(run, number, one))

    def limit(self, speed_mps):
        """Nav2's controller obeys this topic; 0 lifts the limit again."""
        message = SpeedLimit()
        message.header.stamp = self.node.get_clock().now().to_msg()
        message.speed_limit = float(speed_mps)
        self.speed.publish(message)

    def on_answer(self, run, number, future):
        with self.lock:
            goal = future.result()
            run.spoke = time.monotonic()
            if not goal.accepted:
                run.open = False
                run.end("failed", "rejected", f"{self.given.action} rejected the goal")
                return
            if run.final is not None or number != run.sent:
                goal.cancel_goal_async()  # it comes too late: nobody waits for it
                return
            run.goal = goal
            goal.get_result_async().add_done_callback(lambda one: self.on_result(run, number, one))

    def on_feedback(self, run, number, message):
        with self.lock:
            if number == run.sent:
                run.spoke = time.monotonic()
                left = float(message.feedback.distance_remaining)
                run.remaining = left if math.isfinite(left) else run.remaining

    def on_result(self, run, number, future):
        with self.lock:
            if number != run.sent:
                return
            answer = future.result()
            if answer.status not in ENDS:
                return  # the server forgot it: what became of it is asked by cancelling
            run.open = False
            if answer.status == GoalStatus.STATUS_SUCCEEDED:
                run.end("succeeded", message=f"{self.given.action} says SUCCEEDED")
            elif answer.status == GoalStatus.STATUS_ABORTED:
                code = getattr(answer.result, "error_code", 0)
                said = getattr(answer.result, "error_msg", "")
                run.end("failed", "aborted", f"{self.given.action} says ABORTED {code} {said}".strip()[:500])
            elif not run.held:
                run.end("failed", "cancelled_elsewhere", "somebody else cancelled the goal")

    def cancel(self, run, now):
        """Ask until the goal has ended. A server that is gone from the graph runs no goal."""
        if not run.open or now - run.asked < CANCEL_AGAIN_S:
            return
        run.asked = now
        if not self.client.server_is_ready():
            run.open = run.orphan and now - run.heard < ANSWER_S  # after a start, it may not have been found yet
        elif run.goal is not None:
            run.goal.cancel_goal_async()
        elif run.orphan or now - run.spoke > ANSWER_S:
            future = self.cancel_all.call_async(CancelGoal.Request())  # all zeros: every goal of this server
            future.add_done_callback(lambda one: self.on_cancelled_all(run, one))

    def on_cancelled_all(self, run, future):
        with self.lock:
            if not future.result().goals_canceling:
                run.open = False

    def conclude(self, run):
        """Nothing is reported as over while the body moves or the goal may still be alive."""
        report = self.report_of(run, ended=True)
        self.journal.write({"ended": report})
        run.final, self.active = report, None
        self.limit(0.0)

    def start(self, request):
        with self.lock:
            key, fixed = request["identity"]["request_id"], fixed_of(request)
            known = self.requests.get(key)
            if known is not None:
                if known.fixed != fixed:
                    raise refused("The request id came with other contents", "send a new request")
                return self.report_of(known)
            self.check(request)
            token = request["fencing"]["mobile_base"]
            if token < self.newest_token:
                raise Refusal(409, "fencing_refused", "A newer token was seen", "ask for the lease again")
            if self.active is not None:
                raise refused("Another goal is under way", "stop that first")
            with self.senses.lock:
                if not self.senses.localised():
                    raise refused("The robot is not localised: no fresh pose", "localise it, then start again")
                if self.senses.engaged:
                    raise refused("The emergency stop is engaged, or its topic is silent", "release it")
            if not self.client.server_is_ready():
                raise refused(f"No action server on {self.given.action}", "start the navigation stack")
            handle = f"goal-{len(self.requests) + 1}"
            run = Run(request, fixed, handle, self.senses.now())
            self.journal.write({"request": request, "handle": handle, "at_s": run.begun})
            self.newest_token = token
            self.requests[key] = self.active = run
            return self.report_of(run)

    def check(self, request):
        """Only what the card declares is taken: the right provider, every parameter, its type and its bounds."""
        do = "send what the card declares"
        identity, parameters = request["identity"], request["parameters"]
        if (identity["provider_id"], request["capability"]) != (self.card["provider_id"], self.card["capability"]):
            raise refused("The request is for somebody else", do)
        if set(parameters) != {one["name"] for one in self.card["parameters"]}:
            raise refused("A parameter is missing or unknown", do)
        for one in self.card["parameters"]:
            value = parameters[one["name"]]
            if one["type"] == "number":
                fits = number(value) and one["minimum"] <= value <= one["maximum"]
            elif one["type"] == "frame":
                fits = value == self.given.frame
            else:
                fits = isinstance(value, list) and len(value) == 2 and all(map(number, value))
            if not fits:
                raise refused(f"{one['name']} is {value!r}"[:200], do)
        if not number(request["fencing"].get("mobile_base")):
            raise refused("No lease on mobile_base", "send its fencing token")
        if not number(request["deadline_s"]):
            raise refused("deadline_s is no number", do)

    def report_of(self, run, ended=False):
        """How it stands now. What has ended stays as it ended, to the byte, also after a restart."""
        if run.final is not None:
            return run.final
        now, status, failure = self.senses.now(), "running", ""
        if ended:
            status, failure = run.ending
        elif run.ending is not None and run.ending[0] == "cancelled":
            status = "stopping"
        elif run.held and run.ending is None:
            status, failure = "blocked", "keepalive_lost"
        pose = self.senses.pose
        left = run.remaining if run.remaining is not None else math.nan
        if math.isnan(left) and pose is not None:
            left = math.hypot(run.target[0] - pose[1], run.target[1] - pose[2])
        if math.isfinite(left):
            run.whole = max(run.whole or 0.1, left)
            run.share = max(run.share, min(1.0, 1.0 - left / run.whole))
        declared = {}
        if ended and pose is not None:
            declared["distance_m"] = math.hypot(run.target[0] - pose[1], run.target[1] - pose[2])
        return {
            "handle": run.handle,
            "identity": run.request["identity"],
            "status": status,
            "at_s": now,
            "progress": {
                "share": 1.0 if status == "succeeded" else run.share,
                "remaining_m": left if math.isfinite(left) else None,
            },
            "failure": failure,
            "message": run.message if ended else "",
            "declared": declared,
            "proposed_facts": self.proposals(run, declared) if status == "succeeded" else [],
        }

    def proposals(self, run, declared):
        """Of what the request is for, what the stack says to be true: whether it is, the harness measures."""
        found = []
        for one in run.request.get("intended") or []:
            if one["effect"]["predicate"] == "arrival":
                mine = {"target_m": run.target, "frame": run.request["parameters"]["frame"], **declared}
                found.append({"name": "arrival", "arguments": mine})
            elif one["effect"]["predicate"] == "static_body":
                found.append({"name": "static_body", "arguments": {}})
        return found

    def act(self, handle, verb):
        with self.lock:
            run = next((one for one in self.requests.values() if one.handle == handle), None)
            if run is None:
                do = "find it by its request id"
                raise Refusal(404, "unknown_name", f"No execution has the handle {handle}"[:200], do)
            if run.final is None and verb == "stop":
                run.end("cancelled")
            if verb == "keepalive" and not run.held:
                run.heard = time.monotonic()
            if run.final is None and verb == "resume" and run.held:
                run.heard = run.spoke = time.monotonic()
                run.held = False
            return {"handle": handle} if verb == "keepalive" else self.report_of(run)

    def find(self, key):
        with self.lock:
            if key not in self.requests:
                raise Refusal(404, "unknown_name", f"Request {key} never came here"[:200], "send it once")
            return self.report_of(self.requests[key])

    def starts(self):
        with self.lock:
            names = ("request_id", "mission_id", "node_id", "attempt", "provider_id")
            return [
                {**{name: line["request"]["identity"][name] for name in names}, "at_s": line["at_s"], "moves": True}
                for line in self.journal.lines
                if "request" in line
            ]


def fixed_of(request):
    """What makes two requests of one id the same."""
    return [request[name] for name in ("identity", "capability", "parameters")] + [request.get("blobs") or []]


def number(value):
    return not isinstance(value, bool) and isinstance(value, (int, float)) and math.isfinite(value)


class Handler(BaseHTTPRequestHandler):
    """HTTP around both: the token, JSON in, JSON out."""

    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    timeout = 30.0
    senses, goals, navigator, token, given = None, None, None, "", None

    def answer(self, method, path, query, body):
        """The whole protocol, one line for each operation. Without a navigator nothing can be started."""
        on, senses = self.navigator, self.senses
        parts = path.strip("/").split("/")
        if parts[0] in ("providers", "invocations", "requests", "starts") and on is None and path != "/providers":
            if path == "/starts":
                return []
            raise Refusal(404, "unknown_name", "This program only observes", "ask the one that offers providers")
        match [method, *parts]:
            case ["GET", "robot"]:
                return self.robot()
            case ["GET", "clock"]:
                return {"at_s": senses.now(), "speed": 1.0, "monotonic_s": time.monotonic()}
            case ["GET", "providers"]:
                return [on.card] if on else []
            case ["POST", "providers", "navigate_to_pose", "invocations"]:
                return on.start(body)
            case ["GET", "invocations", handle]:
                return on.act(handle, "report")
            case ["GET", "requests", key]:
                return on.find(key)
            case ["POST", "invocations", handle, ("keepalive" | "resume" | "stop") as verb]:
                return on.act(handle, verb)
            case ["GET", "observations"]:
                return self.observations(int(query.get("after", 0)), int(query.get("limit", 5000)))
            case ["GET", "stack", "goals"]:
                return self.goals.after(int(query.get("after", 0)), int(query.get("limit", 1000)))
            case ["GET", "starts"]:
                return on.starts()
            case ["GET", "blobs", digest]:
                with senses.lock:
                    if digest in senses.blobs:
                        return senses.blobs[digest]
                do = "ask for digests it has named lately"
                raise Refusal(404, "blob_damaged", f"No bytes have the digest {digest}"[:200], do)
            case ["GET", "camera"] if senses.picture is not None:
                at, width, height, jpeg = senses.picture
                body = base64.b64encode(jpeg).decode()
                return {"at_s": at, "width_px": width, "height_px": height, "body": body}
        raise Refusal(404, "unknown_name", f"There is no {method} {path}"[:200], "read the OpenAPI document")

    def robot(self):
        senses = self.senses
        with senses.lock:
            moving = not senses.standing()
            return {
                "robot_id": self.given.name, "at_s": senses.now(), "posture": "moving" if moving else "standing",
                "armed": moving or bool(self.navigator and self.navigator.active), "hardware_stop": senses.engaged,
                "charge": senses.charge, "localised": senses.localised(), "map_version": self.given.map_version,
                "pose_age_s": senses.pose_age(),
            }  # fmt: skip

    def observations(self, after, limit):
        with self.senses.lock:
            found = [one for one in self.senses.samples if one["seq"] > after][: max(0, limit)]
            return {"samples": found, "next_seq": found[-1]["seq"] if found else after, "at_s": self.senses.now()}

    def do_GET(self):
        self.serve("GET")

    def do_POST(self):
        self.serve("POST")

    def serve(self, method):
        do = "send what the OpenAPI document describes"
        length = self.headers.get("Content-Length") or "0"
        if not length.isdigit() or int(length) > BODY_BYTES:
            self.close_connection = True
            self.send(422, {"code": "invalid_body", "what": "The body is too long, or of no length", "do": do})
            return
        raw = self.rfile.read(int(length))
        try:
            sent = (self.headers.get("Authorization") or "").encode("latin-1", "replace")
            if not secrets.compare_digest(sent, f"Bearer {self.token}".encode()):
                raise Refusal(401, "unauthorised", "The token is missing or wrong", "send it as a bearer token")
            path, _, parameters = self.path.partition("?")
            query = dict(pair.split("=", 1) for pair in parameters.split("&") if "=" in pair)
            status, content = 200, self.answer(method, path, query, json.loads(raw) if raw else None)
        except Refusal as refusal:
            status, content = refusal.status, refusal.problem
        except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as wrong:
            what = f"The request cannot be read: {wrong}"[:300]
            status, content = 422, {"code": "invalid_body", "what": what, "do": do}
        self.send(status, content)

    def send(self, status, content):
        body = content if isinstance(content, bytes) else json.dumps(content).encode()
        kind = "application/octet-stream" if isinstance(content, bytes) else "application/json"
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *words):
        """Quiet."""


def options(words):
    found = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = found.add_argument
    add("--name", required=True, help="the name that the site's robots.yaml gives this robot")
    add("--map-version", required=True, help="the map that its localiser uses, as in site.yaml")
    add("--bind", default="127.0.0.1", help="another address only behind TLS or inside a private network")
    add("--port", type=int, default=8765)
    add("--token-file", type=pathlib.Path, help="else the variable ROBOT_TOKEN of the environment")
    add("--journal", type=pathlib.Path, help="default: ~/.regen/NAME.jsonl")
    add("--observe", action="store_true", help="evidence only: no provider, no goal, no journal")
    add("--action", default="navigate_to_pose")
    add("--plan-topic", default="plan", help="the planner's path: where it ends is where a goal of others leads to")
    add("--goal-topic", default="goal_pose", help="where others give a goal by a topic and not by the action")
    add("--frame", default="map")
    add("--base-frame", default="base_link")
    add("--pose-topic", default="amcl_pose", help="the localiser's pose with covariance")
    add("--odom-topic", default="odom")
    add("--scan-topic", default="scan")
    add("--imu-topic", default="imu")
    add("--battery-topic", default="battery_state")
    add("--image-topic", default="", help="a CompressedImage in JPEG: the live picture of the console")
    add("--speed-limit-topic", default="speed_limit")
    add("--stop-topic", default="emergency_stop", help="a Bool that is true while the emergency stop is engaged")
    add("--no-stop-topic", action="store_true", help="there is none: the stop is then said to be released always")
    add("--localised-within", type=float, default=0.5, help="largest standard deviation of a usable pose, metres")
    add("--goal-tolerance", type=float, default=0.25, help="xy_goal_tolerance of the stack's goal checker, metres")
    add("--max-speed", type=float, default=0.5)
    add("--stops-within", type=float, default=3.0, help="seconds from a stop to a standstill")
    add("--feedback-timeout", type=float, default=3.0, help="a server that is silent for so long is lost, seconds")
    add("--embodiment", default="wheels")
    add("--version", default="1.0", help="what its card says: a new one asks for a new check")
    return found.parse_args(words)


def main():
    rclpy.init(args=sys.argv)
    given = options(rclpy.utilities.remove_ros_args(sys.argv)[1:])
    token = given.token_file.read_text().strip() if given.token_file else os.environ.get("ROBOT_TOKEN", "")
    if not token:
        sys.exit("No token: set ROBOT_TOKEN, or name a file with --token-file.")
    node = Node("regen_observer" if given.observe else "regen_sidecar")
    Handler.senses, Handler.token, Handler.given = Senses(node, given), token, given
    Handler.goals = StackGoals(node, given)
    if not given.observe:
        path = given.journal or pathlib.Path.home() / ".regen" / f"{given.name}.jsonl"
        Handler.navigator = Navigator(node, Handler.senses, Journal(path), given)
    server = ThreadingHTTPServer((given.bind, given.port), Handler)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    print(f"http://{given.bind}:{server.server_port}", flush=True)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        executor.spin()


if __name__ == "__main__":
    main()
