"""Builds the body and the sensors of one fidelity; what walks is loaded only for those who ask for it."""

import msgspec

from harness.contracts.simulation import Fidelity
from simulator.bodies import BodyState, KinematicBody, MujocoBody, SimulatedBody
from simulator.noise import Streams
from simulator.samples import SampleRing
from simulator.sensors import Fix, Sensors
from simulator.solids import SiteModel
from simulator.walking.go2_package import require_walking


class Embodiment(msgspec.Struct, frozen=True):
    """A body and the sensors that it carries."""

    body: SimulatedBody
    sensors: Sensors


def embodiment(
    fidelity: Fidelity,
    site: SiteModel,
    state: BodyState,
    *,
    ring: SampleRing,
    streams: Streams,
    stance: tuple[float, ...] = (),
    began: Fix | None = None,
) -> Embodiment:
    """`stance`: the joints at the last save. `began`: the pose at which a walking robot is said to be switched on.

    Raises ContractInvalid with the command that installs what is missing.
    """
    if fidelity == "walking":
        require_walking()
        from simulator.walking.body import WalkingBody  # noqa: PLC0415  an extra: loaded only to walk
        from simulator.walking.sensors import WalkingSensors  # noqa: PLC0415  as above

        walking = WalkingBody(site, state, stance=stance)
        return Embodiment(body=walking, sensors=WalkingSensors(streams, ring, walking, site, began=began))
    body = MujocoBody(site, state) if fidelity == "mujoco" else KinematicBody(site, state)
    return Embodiment(body=body, sensors=Sensors(streams, ring, frame=site.frame, map_version=site.map_version))
