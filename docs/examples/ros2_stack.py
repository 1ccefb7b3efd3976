#!/usr/bin/env python3
"""Stands for the nodes that run on your ROS 2 robot: a simulated base with its sensors, or a NavigateToPose server.

ros2_stack.py base docs/examples/hall.yaml
ros2_stack.py navigation docs/examples/hall.yaml
ros2_stack.py tour docs/examples/hall.yaml

`base` drives in the map by /cmd_vel and publishes /odom, /tf, /scan, /amcl_pose, /battery_state, /emergency_stop.
`navigation` is a NavigateToPose action server that plans on the same map. It is no Nav2: it speaks Nav2's interface.
`tour` stands for whatever gives your robot its goals today: it sends one after the other, round three places.
The other options make them lie or fail; tests/peers uses them.
"""

import argparse
import collections
import contextlib
import math
import os
import pathlib
import random
import sys
import threading
import time
import zlib

import rclpy
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TransformStamped, Twist
from nav2_msgs.action import NavigateToPose
from nav2_msgs.msg import SpeedLimit
from nav_msgs.msg import Odometry, Path
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import BatteryState, LaserScan
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PERIOD_S, BEAMS, REACH_M = 0.05, 120, 8.0
FASTEST_MPS, TURN_RADPS, BRAKE_MPS2 = 0.5, 1.2, 1.5
CLEAR_M = 0.3
PLACES, PAUSE_S = ((1.2, -0.6), (2.4, -1.4), (0.0, 0.0)), 4.0


class Map:
    """A map_server map of an 8-bit grey PNG: which cells are walls."""

    def __init__(self, file):
        lines = file.read_text().replace("[", " ").replace("]", " ").splitlines()
        said = dict(line.split(":", 1) for line in lines if ":" in line)
        self.cell = float(said["resolution"])
        self.left, self.bottom = map(float, said["origin"].split(",")[:2])
        self.rows = grey(file.with_name(said["image"].strip()).read_bytes())[::-1]

    def at(self, x, y):
        return int((x - self.left) / self.cell), int((y - self.bottom) / self.cell)

    def wall(self, x, y):
        column, row = self.at(x, y)
        inside = 0 <= row < len(self.rows) and 0 <= column < len(self.rows[0]) and x >= self.left and y >= self.bottom
        return not inside or self.rows[row][column] < 128

    def way(self, start, goal, step=0.1):
        """Points from start to goal, clear of walls: breadth first over cells of `step` metres. None: no way."""

        def point(cell):
            return start[0] + cell[0] * step, start[1] + cell[1] * step

        def free(cell):
            x, y = point(cell)
            around = [k * math.pi / 4 for k in range(8)]
            return not any(self.wall(x + CLEAR_M * math.cos(a), y + CLEAR_M * math.sin(a)) for a in around)

        queue, came = collections.deque([(0, 0)]), {(0, 0): None}
        while queue:
            cell = queue.popleft()
            if math.dist(point(cell), goal) < step:
                found = [goal]
                while cell is not None:
                    found.append(point(cell))
                    cell = came[cell]
                return found[::-1]
            for dx, dy in ((1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
                other = cell[0] + dx, cell[1] + dy
                if other not in came and free(other):
                    came[other] = cell
                    queue.append(other)
        return None


def grey(body):
    """Rows of a PNG with one byte a pixel, not interlaced."""
    at, packed, width = 8, b"", 0
    while at < len(body):
        size, kind = int.from_bytes(body[at : at + 4], "big"), body[at + 4 : at + 8]
        if kind == b"IHDR":
            width = int.from_bytes(body[at + 8 : at + 12], "big")
            assert body[at + 16 : at + 21] == b"\x08\0\0\0\0", "an 8-bit grey PNG is needed"
        packed += body[at + 8 : at + 8 + size] if kind == b"IDAT" else b""
        at += size + 12
    raw, rows, above = zlib.decompress(packed), [], bytes(width)
    for start in range(0, len(raw), width + 1):
        row = bytearray(raw[start + 1 : start + 1 + width])
        for k in range(width):
            a, b, c = (row[k - 1], above[k], above[k - 1]) if k else (0, above[k], 0)
            nearest = min((abs(b - c), 0, a), (abs(a - c), 1, b), (abs(a + b - 2 * c), 2, c))[2]
            row[k] = (row[k] + (0, a, b, (a + b) // 2, nearest)[raw[start]]) & 255
        rows.append(bytes(row))
        above = row
    return rows


class Base(Node):
    """Wheels, laser, localiser, battery. It brakes by itself half a second after the last order."""

    def __init__(self, given):
        super().__init__("base")
        self.given, self.map = given, Map(given.map)
        self.x, self.y = given.start
        self.yaw = self.v = self.w = 0.0
        self.odom = [0.0, 0.0, 0.0]  # what the wheels add up to: it drifts
        self.order, self.ordered = (0.0, 0.0), 0.0
        self.ticks = self.driven = 0
        self.out = {
            name: self.create_publisher(kind, name, qos)
            for name, kind, qos in (
                ("odom", Odometry, 10), ("/tf", TFMessage, 100), ("/tf_static", TFMessage, LATCHED),
                ("scan", LaserScan, 5), ("amcl_pose", PoseWithCovarianceStamped, LATCHED),
                ("battery_state", BatteryState, 5), ("emergency_stop", Bool, LATCHED),
            )
        }  # fmt: skip
        self.create_subscription(Twist, "cmd_vel", self.on_order, 5)
        self.out["/tf_static"].publish(TFMessage(transforms=[self.link("base_link", "laser", (0.2, 0.0, 0.0))]))
        self.out["emergency_stop"].publish(Bool(data=given.stop_engaged))
        self.create_timer(PERIOD_S, self.tick)

    def stamp(self):
        return (self.get_clock().now() - Duration(seconds=self.given.stamps_behind)).to_msg()

    def on_order(self, message):
        self.order, self.ordered = (message.linear.x, message.angular.z), time.monotonic()

    def tick(self):
        v, w = self.order if time.monotonic() - self.ordered < 0.5 else (0.0, 0.0)
        change = BRAKE_MPS2 * PERIOD_S
        self.v += max(-change, min(change, v - self.v))
        self.w = w
        self.yaw += self.w * PERIOD_S
        x, y = self.x + self.v * PERIOD_S * math.cos(self.yaw), self.y + self.v * PERIOD_S * math.sin(self.yaw)
        if self.map.wall(x, y):
            self.v = 0.0
        else:
            self.x, self.y = x, y
            self.odom[0] += 1.002 * self.v * PERIOD_S * math.cos(self.odom[2])
            self.odom[1] += 1.002 * self.v * PERIOD_S * math.sin(self.odom[2])
        self.odom[2] += self.w * PERIOD_S
        self.ticks += 1
        self.driven += abs(self.v) > 0.1
        if self.driven == round(self.given.stop_after / PERIOD_S) > 0:
            self.out["emergency_stop"].publish(Bool(data=True))
        self.publish()

    def publish(self):
        stamp, (ox, oy, oyaw) = self.stamp(), self.odom
        said = Odometry()
        said.header.stamp, said.header.frame_id, said.child_frame_id = stamp, "odom", "base_link"
        said.pose.pose.position.x, said.pose.pose.position.y = ox, oy
        said.pose.pose.orientation.z, said.pose.pose.orientation.w = math.sin(oyaw / 2), math.cos(oyaw / 2)
        said.twist.twist.linear.x, said.twist.twist.angular.z = self.v, self.w
        self.out["odom"].publish(said)
        links = [self.link("odom", "base_link", (ox, oy, oyaw), stamp)]
        if not self.given.no_localiser:
            noise = random.gauss
            x, y, yaw = self.x + noise(0, 0.005), self.y + noise(0, 0.005), self.yaw + noise(0, 0.002)
            turn = yaw - oyaw
            c, s = math.cos(turn), math.sin(turn)
            links.append(self.link("map", "odom", (x - c * ox + s * oy, y - s * ox - c * oy, turn), stamp))
            if self.ticks % 10 == 1:
                seen = PoseWithCovarianceStamped()
                seen.header.stamp, seen.header.frame_id = stamp, "map"
                seen.pose.pose.position.x, seen.pose.pose.position.y = x, y
                seen.pose.covariance[0] = seen.pose.covariance[7] = self.given.spread**2
                self.out["amcl_pose"].publish(seen)
        self.out["/tf"].publish(TFMessage(transforms=links))
        if self.ticks % 4 == 0:
            self.out["scan"].publish(self.scan(stamp))
        if self.ticks % 20 == 0:
            charge = BatteryState(percentage=0.8)
            charge.header.stamp = stamp
            self.out["battery_state"].publish(charge)

    def scan(self, stamp):
        said = LaserScan(angle_min=-math.pi, angle_increment=math.tau / BEAMS, range_min=0.05, range_max=REACH_M)
        said.angle_max = said.angle_min + said.angle_increment * (BEAMS - 1)
        said.header.stamp, said.header.frame_id = stamp, "laser"
        x, y = self.x + 0.2 * math.cos(self.yaw), self.y + 0.2 * math.sin(self.yaw)
        ranges = []
        for beam in range(BEAMS):
            angle, reach = self.yaw + said.angle_min + beam * said.angle_increment, 0.1
            while reach < REACH_M and not self.map.wall(x + reach * math.cos(angle), y + reach * math.sin(angle)):
                reach += self.map.cell
            ranges.append(reach if reach < REACH_M else math.inf)
        said.ranges = ranges
        return said

    def link(self, parent, child, pose, stamp=None):
        found = TransformStamped()
        found.header.frame_id, found.child_frame_id = parent, child
        found.header.stamp = stamp or self.stamp()
        found.transform.translation.x, found.transform.translation.y = pose[0], pose[1]
        found.transform.rotation.z, found.transform.rotation.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)
        return found


class Navigation(Node):
    """NavigateToPose: plans on the map, follows its way by /cmd_vel, one goal at a time."""

    def __init__(self, given):
        super().__init__("navigation")
        self.given, self.map, self.links = given, Map(given.map), {}
        self.cap = FASTEST_MPS
        self.out = self.create_publisher(Twist, "cmd_vel", 5)
        self.plans, self.goals = self.create_publisher(Path, "plan", 1), 0
        self.create_subscription(TFMessage, "/tf", self.on_transforms, 100)
        self.create_subscription(SpeedLimit, "speed_limit", self.on_limit, 5)
        self.busy = threading.Lock()
        self.server = ActionServer(
            self, NavigateToPose, "navigate_to_pose", self.execute,
            goal_callback=lambda goal: GoalResponse.REJECT if given.reject else GoalResponse.ACCEPT,
            cancel_callback=lambda goal: CancelResponse.REJECT if given.deaf else CancelResponse.ACCEPT,
        )  # fmt: skip

    def on_transforms(self, message):
        for one in message.transforms:
            t, q = one.transform.translation, one.transform.rotation
            self.links[one.child_frame_id] = (t.x, t.y, 2 * math.atan2(q.z, q.w))

    def on_limit(self, message):
        self.cap = min(FASTEST_MPS, message.speed_limit or FASTEST_MPS)

    def where(self):
        if not {"odom", "base_link"} <= self.links.keys():
            return None
        (x, y, turn), (ox, oy, oyaw) = self.links["odom"], self.links["base_link"]
        c, s = math.cos(turn), math.sin(turn)
        return x + c * ox - s * oy, y + s * ox + c * oy, turn + oyaw

    def execute(self, goal):
        with self.busy:
            return self.follow(goal)

    def follow(self, goal):
        p, begun, result = goal.request.pose.pose.position, time.monotonic(), NavigateToPose.Result()
        while (here := self.where()) is None and time.monotonic() < begun + 5.0:
            time.sleep(PERIOD_S)  # its transforms come in a moment
        way = self.map.way(here[:2], (p.x, p.y)) if here else None
        if way is None:
            result.error_code, result.error_msg = 208, "no way to the goal"
            goal.abort()
            return result
        self.goals += 1
        claims, planned = self.given.claims and self.goals % self.given.claims == 0, 0.0
        while way and not claims:
            if time.monotonic() - planned > 1.0:
                planned = time.monotonic()
                self.publish(way)
            here = self.where()
            if goal.is_cancel_requested:
                self.drive(0.0, 0.0)
                goal.canceled()
                return result
            left = sum(map(math.dist, way, way[1:])) + math.dist(way[0], here[:2])
            if left < 0.1 + self.given.short_of:
                break
            if self.given.vanish_after and time.monotonic() - begun > self.given.vanish_after:
                os._exit(1)
            while len(way) > 1 and math.dist(way[0], here[:2]) < 0.25:
                way.pop(0)
            error = math.remainder(math.atan2(way[0][1] - here[1], way[0][0] - here[0]) - here[2], math.tau)
            slow = math.sqrt(2 * 0.5 * max(0.0, left - self.given.short_of))
            self.drive(0.0 if abs(error) > 0.6 else min(self.cap, slow), max(-TURN_RADPS, min(TURN_RADPS, 3 * error)))
            said = NavigateToPose.Feedback(distance_remaining=float(left))
            goal.publish_feedback(said)
            time.sleep(PERIOD_S)
        if claims:
            self.publish(way)
            time.sleep(2.0)
        self.drive(0.0, 0.0)
        goal.succeed()
        return result

    def publish(self, way):
        """The plan as Nav2's planner gives it, stamped when it was made."""
        said = Path()
        said.header.frame_id, said.header.stamp = "map", self.get_clock().now().to_msg()
        for x, y in way:
            point = PoseStamped(header=said.header)
            point.pose.position.x, point.pose.position.y = float(x), float(y)
            said.poses.append(point)
        self.plans.publish(said)

    def drive(self, v, w):
        order = Twist()
        order.linear.x, order.angular.z = float(v), float(w)
        self.out.publish(order)


class Tour(Node):
    """Sends goals to the action server, one after the other: each when the one before is over, however it ended."""

    def __init__(self, given):
        super().__init__("tour")
        self.client = ActionClient(self, NavigateToPose, "navigate_to_pose")
        self.next, self.busy, self.since = 0, False, 0.0
        self.create_timer(PERIOD_S, self.tick)

    def tick(self):
        if self.busy or time.monotonic() - self.since < PAUSE_S or not self.client.server_is_ready():
            return
        self.busy, goal = True, NavigateToPose.Goal()
        goal.pose.header.frame_id, goal.pose.header.stamp = "map", self.get_clock().now().to_msg()
        goal.pose.pose.position.x, goal.pose.pose.position.y = PLACES[self.next % len(PLACES)]
        self.next += 1
        self.client.send_goal_async(goal).add_done_callback(self.on_answer)

    def on_answer(self, future):
        goal = future.result()
        if goal.accepted:
            goal.get_result_async().add_done_callback(self.on_end)
        else:
            self.on_end(None)

    def on_end(self, future):
        self.busy, self.since = False, time.monotonic()


def main():
    found = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    found.add_argument("part", choices=["base", "navigation", "tour"])
    found.add_argument("map", type=pathlib.Path)
    found.add_argument("--start", type=float, nargs=2, default=(0.0, 0.0))
    found.add_argument("--spread", type=float, default=0.05, help="the localiser's own standard deviation, metres")
    found.add_argument("--stamps-behind", type=float, default=0.0, help="stamps that are so many seconds too old")
    found.add_argument("--no-localiser", action="store_true", help="no transform from map to odom")
    found.add_argument("--stop-engaged", action="store_true")
    found.add_argument("--stop-after", type=float, default=0.0, help="engage it after so much driving, seconds")
    found.add_argument("--reject", action="store_true", help="reject every goal")
    found.add_argument("--deaf", action="store_true", help="reject every cancel")
    found.add_argument("--short-of", type=float, default=0.0, help="say SUCCEEDED so many metres before the goal")
    found.add_argument("--claims", type=int, default=0, help="call every so many goals done without driving")
    found.add_argument("--vanish-after", type=float, default=0.0, help="end the process so far into a goal, seconds")
    rclpy.init()
    given = found.parse_args(rclpy.utilities.remove_ros_args(sys.argv)[1:])
    node = {"base": Base, "navigation": Navigation, "tour": Tour}[given.part](given)
    executor = MultiThreadedExecutor(3)
    executor.add_node(node)
    print(f"{given.part} runs", flush=True)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        executor.spin()


if __name__ == "__main__":
    main()
