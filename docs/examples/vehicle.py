#!/usr/bin/env python3
"""A vehicle that speaks VDA 5050 over MQTT: it drives orders over an empty floor. It needs `pip install paho-mqtt`.

It stands for yours, and was written from the specification alone. `Vehicle` takes messages and says what to send;
`main` connects it to a broker. Version 2.1; with `--protocol 3.0` the names that 3.0 changed.

python docs/examples/vehicle.py --broker 127.0.0.1:1883 --manufacturer Acme --serial 0001 --map hall-1
"""

import argparse
import json
import math
import random
import time
from datetime import UTC, datetime
from itertools import pairwise

from paho.mqtt import client as mqtt

PERIOD_S = 0.05  # the control loop
LOOKED_S = 0.1  # how often position and velocity are published
STATE_S = 1.0  # how often the state is published without news
SPEED_MPS, BRAKE_MPS2, TURN_RADPS = 0.8, 1.5, 1.5
REACHABLE_M = 0.5
DRIVES = ("AUTOMATIC", "SEMIAUTOMATIC")


class Vehicle:
    """One vehicle on its floor. `send(topic, message, retained)` publishes; `clock()` is its own UTC time."""

    def __init__(self, send, clock, *, manufacturer="Acme", serial="0001", map_id="hall-1", protocol="2.1"):
        self.send, self.clock = send, clock
        self.manufacturer, self.serial, self.map_id, self.protocol = manufacturer, serial, map_id, protocol
        self.x = self.y = self.yaw = self.v = self.w = 0.0  # where it truly is: nobody is told
        self.numbers, self.looked, self.stated = {}, 0.0, 0.0
        self.order, self.update, self.nodes, self.edges = "", 0, [], []  # nodes and edges that are left
        self.last_node, self.last_sequence = "", 0
        self.actions, self.errors = [], []
        self.paused, self.mode, self.stop, self.localised, self.battery = False, "AUTOMATIC", "NONE", True, 80.0
        self.driven = []  # every order id that it accepted as new, for whoever counts

    # --- what comes in -------------------------------------------------------------------------------------------

    def receive(self, topic, message):
        if topic == "order":
            self.take_order(message)
        elif topic == "instantActions":
            for action in message["actions"]:
                self.act(action)
        self.publish_state()

    def take_order(self, order):
        """A new order, an update of the one it has, or a repeat, which changes nothing."""
        same = order["orderId"] == self.order
        if same and order["orderUpdateId"] == self.update:
            return
        wrong = self.wrong_update(order) if same else self.wrong_order(order)
        if wrong:
            self.refuse(order, *wrong)
            return
        self.errors = [one for one in self.errors if not one["errorType"].startswith(("order", "validation"))]
        if not same:
            self.driven.append(order["orderId"])
            self.actions, self.nodes, self.edges = [], [], []
            first = order["nodes"][0]
            self.last_node, self.last_sequence = first["nodeId"], first["sequenceId"]
        self.order, self.update = order["orderId"], order["orderUpdateId"]
        joint = order["nodes"][0]["sequenceId"]
        self.nodes = [one for one in self.nodes if one["sequenceId"] <= joint and one["released"]]
        self.edges = [one for one in self.edges if one["sequenceId"] < joint and one["released"]]
        self.nodes += order["nodes"][1:]
        self.edges += order["edges"]

    def wrong_order(self, order):
        if not order["nodes"] or len(order["edges"]) != len(order["nodes"]) - 1:
            return "validationError", "an order has one edge less than it has nodes"
        if self.mode not in DRIVES:
            return "orderError", f"the operating mode is {self.mode}"
        if self.nodes:
            return "orderError", "another order is under way"
        place = order["nodes"][0]["nodePosition"]
        if place["mapId"] != self.map_id:
            return "orderError", f"there is no map {place['mapId']}"
        if math.dist((place["x"], place["y"]), (self.x, self.y)) > REACHABLE_M:
            return "orderError", "the first node cannot be reached"
        return None

    def wrong_update(self, order):
        if order["orderUpdateId"] < self.update:
            return "orderUpdateError", "the update is older than the one it has"
        ends = [one["sequenceId"] for one in self.nodes if one["released"]] or [self.last_sequence]
        if order["nodes"][0]["sequenceId"] != ends[-1]:
            return "orderUpdateError", "the update does not begin where the base ends"
        return None

    def refuse(self, order, kind, text):
        references = [("orderId", order["orderId"]), ("orderUpdateId", str(order["orderUpdateId"]))]
        self.errors.append(
            {
                "errorType": kind,
                "errorLevel": "WARNING",
                "errorDescription": text,
                "errorReferences": [{"referenceKey": key, "referenceValue": value} for key, value in references],
            }
        )

    def act(self, action):
        kind, status = action["actionType"], "FINISHED"
        if kind == "cancelOrder":
            status = "FINISHED" if self.nodes else "FAILED"
            self.nodes, self.edges, self.paused = [], [], False
        elif kind in ("startPause", "stopPause"):
            self.paused = kind == "startPause"
        elif kind == "factsheetRequest":
            self.publish_factsheet()
        elif kind != "stateRequest":
            status = "FAILED"
        self.actions = [
            *self.actions[-20:],
            {"actionId": action["actionId"], "actionType": kind, "actionStatus": status},
        ]

    # --- what it does --------------------------------------------------------------------------------------------

    def tick(self, dt):
        """One turn of the control loop: drive towards the next released node, or brake."""
        target = next((one for one in self.nodes if one["released"]), None)
        speed = turn = 0.0
        if target is not None and not self.paused and self.stop == "NONE" and self.mode in DRIVES:
            speed, turn = self.towards(target)
        change = BRAKE_MPS2 * dt
        self.v += max(-change, min(change, speed - self.v))
        self.w = turn if self.v > 0.0 or turn else 0.0
        self.yaw = math.remainder(self.yaw + self.w * dt, math.tau)
        self.x += self.v * math.cos(self.yaw) * dt
        self.y += self.v * math.sin(self.yaw) * dt
        now = self.clock()
        if now - self.looked >= LOOKED_S - 1e-6:
            self.looked = now
            self.publish("visualization", self.body())
        if now - self.stated >= STATE_S:
            self.publish_state()

    def towards(self, node):
        place = node["nodePosition"]
        left = math.dist((place["x"], place["y"]), (self.x, self.y))
        base = [one["nodePosition"] for one in self.nodes if one["released"]]
        more = sum(math.dist((a["x"], a["y"]), (b["x"], b["y"])) for a, b in pairwise(base))
        if left < (0.03 if len(base) == 1 else 0.2):
            self.pass_node(node)
            return (0.0 if len(base) == 1 else self.v), 0.0
        error = math.remainder(math.atan2(place["y"] - self.y, place["x"] - self.x) - self.yaw, math.tau)
        turn = max(-TURN_RADPS, min(TURN_RADPS, 3.0 * error))
        edge = next((one for one in self.edges if one["sequenceId"] == node["sequenceId"] - 1), {})
        allowed = edge.get("maxSpeed", edge.get("maximumSpeed", SPEED_MPS))
        slow = math.sqrt(2 * 0.7 * (left + more))
        return (0.0 if abs(error) > 0.6 else min(SPEED_MPS, allowed, slow)), turn

    def pass_node(self, node):
        self.last_node, self.last_sequence = node["nodeId"], node["sequenceId"]
        self.nodes = [one for one in self.nodes if one["sequenceId"] > node["sequenceId"]]
        self.edges = [one for one in self.edges if one["sequenceId"] > node["sequenceId"]]
        self.publish_state()

    # --- what goes out -------------------------------------------------------------------------------------------

    def header(self, topic):
        self.numbers[topic] = self.numbers.get(topic, 0) + 1
        stamp = datetime.fromtimestamp(self.clock(), UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
        return {
            "headerId": self.numbers[topic],
            "timestamp": stamp,
            "version": f"{self.protocol}.0",
            "manufacturer": self.manufacturer,
            "serialNumber": self.serial,
        }

    def publish(self, topic, content, retained=False):
        self.send(topic, self.header(topic) | content, retained)

    def body(self):
        """Position by its localiser, which is noisy, and velocity by its wheels, which are a little too large."""
        noise = random.gauss
        third = self.protocol == "3.0"
        position = {
            "x": self.x + noise(0, 0.004), "y": self.y + noise(0, 0.004), "theta": self.yaw, "mapId": self.map_id,
            "localized" if third else "positionInitialized": self.localised,
        }  # fmt: skip
        velocity = {"vx": self.v * 1.003, "vy": 0.0, "omega": self.w}
        return {"mobileRobotPosition" if third else "agvPosition": position, "velocity": velocity}

    def publish_state(self):
        self.stated = self.clock()
        third = self.protocol == "3.0"
        left = [{name: one[name] for name in ("nodeId", "sequenceId", "released")} for one in self.nodes]
        edges = [{name: one[name] for name in ("edgeId", "sequenceId", "released")} for one in self.edges]
        content = {
            "orderId": self.order, "orderUpdateId": self.update, "lastNodeId": self.last_node,
            "lastNodeSequenceId": self.last_sequence, "nodeStates": left, "edgeStates": edges,
            "driving": self.v > 0.0 or self.w != 0.0, "paused": self.paused, "operatingMode": self.mode,
            "errors": self.errors, "information": [],
        }  # fmt: skip
        if third:
            content |= {
                "powerSupply": {"stateOfCharge": self.battery, "charging": False}, "actionStates": [],
                "instantActionStates": self.actions,
                "safetyState": {"activeEmergencyStop": self.stop, "fieldViolation": False},
            }  # fmt: skip
        else:
            content |= {
                "batteryState": {"batteryCharge": self.battery, "charging": False}, "actionStates": self.actions,
                "safetyState": {"eStop": self.stop, "fieldViolation": False},
            }  # fmt: skip
        self.publish("state", content | self.body())

    def publish_connection(self, state="ONLINE"):
        self.publish("connection", {"connectionState": state}, retained=True)

    def publish_factsheet(self):
        third = self.protocol == "3.0"
        actions = [{"actionType": kind} for kind in ("cancelOrder", "startPause", "stopPause", "stateRequest")]
        self.publish(
            "factsheet",
            {
                "typeSpecification": {"seriesName": "example"},
                "physicalParameters": {"maximumSpeed" if third else "speedMax": SPEED_MPS},
                "protocolFeatures": {"mobileRobotActions" if third else "agvActions": actions},
            },
            retained=True,
        )


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--broker", default="127.0.0.1:1883", help="host:port")
    options.add_argument("--interface", default="uagv")
    options.add_argument("--manufacturer", default="Acme")
    options.add_argument("--serial", default="0001")
    options.add_argument("--map", default="hall-1", help="its own id of the map it drives on")
    options.add_argument("--protocol", default="2.1", choices=("2.1", "3.0"))
    given = options.parse_args()
    prefix = f"{given.interface}/v{given.protocol[0]}/{given.manufacturer}/{given.serial}"
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2, client_id=f"vehicle-{given.serial}")

    def send(topic, message, retained):
        client.publish(f"{prefix}/{topic}", json.dumps(message), qos=int(topic == "connection"), retain=retained)

    vehicle = Vehicle(
        send, time.time, manufacturer=given.manufacturer, serial=given.serial, map_id=given.map, protocol=given.protocol
    )
    broken = "CONNECTION_BROKEN" if given.protocol == "3.0" else "CONNECTIONBROKEN"
    will = vehicle.header("connection") | {"connectionState": broken}
    client.will_set(f"{prefix}/connection", json.dumps(will), qos=1, retain=True)
    arrived = []  # taken in the control loop, so that one thread alone touches the vehicle

    def connected(client, data, flags, code, properties):
        client.subscribe([(f"{prefix}/order", 0), (f"{prefix}/instantActions", 0)])
        arrived.append(("connection", {}))

    client.on_connect = connected
    client.on_message = lambda client, data, message: arrived.append(
        (message.topic.rpartition("/")[2], json.loads(message.payload))
    )
    host, _, port = given.broker.partition(":")
    client.connect(host, int(port), keepalive=5)
    client.loop_start()
    print(prefix, flush=True)
    before = time.monotonic()
    while True:
        time.sleep(PERIOD_S)
        while arrived:
            topic, message = arrived.pop(0)
            if topic == "connection":
                vehicle.publish_connection()
                vehicle.publish_factsheet()
            vehicle.receive(topic, message)
        now = time.monotonic()
        vehicle.tick(min(now - before, 0.2))
        before = now


if __name__ == "__main__":
    main()
