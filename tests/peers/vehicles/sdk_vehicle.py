"""A vehicle over vda5050-sdk: the library speaks VDA 5050 2.1, this program drives. Run by the peer's own Python.

python sdk_vehicle.py PORT MANUFACTURER SERIAL MAP
"""

import asyncio
import math
import sys

from vda5050 import VehicleClient, VehicleConfig
from vda5050.model.enums import OperatingMode
from vda5050.model.state import Map
from vda5050.model.visualization import Visualization

PERIOD_S, BRAKE_MPS2 = 0.05, 1.5


class Wheels:
    """Where the vehicle is, and how fast."""

    def __init__(self):
        self.x = self.y = self.yaw = self.v = 0.0

    def step(self, target, allowed):
        goal = 0.0
        if target is not None:
            left = math.dist((target.x, target.y), (self.x, self.y))
            if left > 0.03:
                self.yaw = math.atan2(target.y - self.y, target.x - self.x)
                goal = min(allowed, math.sqrt(2 * 0.7 * left))
        change = BRAKE_MPS2 * PERIOD_S
        self.v += max(-change, min(change, goal - self.v))
        self.x += self.v * math.cos(self.yaw) * PERIOD_S
        self.y += self.v * math.sin(self.yaw) * PERIOD_S


async def main(port, manufacturer, serial, map_id):
    config = VehicleConfig(
        manufacturer=manufacturer, serial_number=serial, broker_url=f"mqtt://127.0.0.1:{port}", state_interval=1.0
    )
    wheels, speeds, waiting = Wheels(), {}, {}
    async with VehicleClient(config) as client:
        publisher = client.publisher

        @client.on_order
        def taken(order):
            """The library drops base nodes before the node where an update begins; they are still to be passed."""
            speeds.update({edge.sequence_id + 1: edge.max_speed for edge in order.edges})
            if order.order_update_id == 0:
                waiting.clear()
                publisher.last_node_id, publisher.last_node_sequence_id = order.nodes[0].node_id, 0
            known = {node.sequence_id for node in publisher.node_states}
            before = [node for number, node in sorted(waiting.items()) if number not in known]
            publisher.node_states = [
                node for node in [*before, *publisher.node_states] if node.sequence_id > publisher.last_node_sequence_id
            ]
            waiting.update({node.sequence_id: node for node in publisher.node_states})

        publisher.set_operating_mode(OperatingMode.AUTOMATIC)
        publisher.set_maps([Map(map_id=map_id, map_version="1", map_status="ENABLED")])
        print("ready", flush=True)
        turn = 0
        while True:
            target = next((node for node in publisher.node_states if node.released), None)
            place = None if target is None or publisher.paused else target.node_position
            wheels.step(place, speeds.get(target.sequence_id) or 0.8 if target is not None else 0.0)
            publisher.update_position(x=wheels.x, y=wheels.y, theta=wheels.yaw, map_id=map_id)
            publisher.set_velocity(vx=wheels.v, vy=0.0, omega=0.0)
            if publisher.agv_position is not None:
                publisher.agv_position.position_initialized = True
            moving = wheels.v > 0.0
            if publisher.driving != moving:
                publisher.set_driving(moving)
            if place is not None and math.dist((place.x, place.y), (wheels.x, wheels.y)) <= 0.05:
                edge = next((one for one in publisher.edge_states if one.sequence_id == target.sequence_id - 1), None)
                if edge is not None:
                    publisher.mark_edge_traversed(edge.edge_id, edge.sequence_id)
                waiting.pop(target.sequence_id, None)
                publisher.mark_node_traversed(target.node_id, target.sequence_id)
                publisher.node_states = [one for one in publisher.node_states if one.sequence_id > target.sequence_id]
                if not publisher.node_states:
                    publisher.edge_states = []
            turn += 1
            if turn % 2 == 0:
                seen = Visualization.model_validate(
                    {"headerId": 0, "version": "2.1.0", "manufacturer": manufacturer, "serialNumber": serial}
                )
                seen.agv_position, seen.velocity = publisher.agv_position, publisher.velocity
                await client.publish_visualization(seen)
            await asyncio.sleep(PERIOD_S)


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:]))
