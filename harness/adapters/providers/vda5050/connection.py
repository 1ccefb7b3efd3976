"""Connects a VDA 5050 vehicle by its broker, and keeps its control loop running until the block ends."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from importlib.util import find_spec
from pathlib import Path

from harness.adapters.ids import SystemIds
from harness.adapters.providers.vda5050.listened import ListenedVehicle
from harness.adapters.providers.vda5050.robot import ControlLoop, MessageLink, VehicleRobot, VehicleSettings
from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import because
from harness.contracts.values import Value

EXTRA = "vda5050"


class BrokerAccess(Value):
    """Where a broker is, and who asks. `authority_file`: a certificate authority, else the machine's own are used."""

    address: str
    user: str = ""
    password: str = ""
    authority_file: str = ""


@contextmanager
def connected_vehicle(settings: VehicleSettings, broker: BrokerAccess, *, journal: Path) -> Iterator[VehicleRobot]:
    """The vehicle, met and followed. Raises ProviderUnreachable where broker or vehicle do not answer, ContractInvalid
    where the MQTT library is not installed or a file is missing."""
    link = _link(settings, broker)
    try:
        robot = VehicleRobot(settings, link, journal=journal)
    except BaseException:
        link.close()
        raise
    with closing(robot), closing(ControlLoop(robot.tick)):
        yield robot


@contextmanager
def listened_vehicle(settings: VehicleSettings, broker: BrokerAccess) -> Iterator[ListenedVehicle]:
    """The vehicle of another master control, listened to: nothing is published. Raises ProviderUnreachable where the
    broker does not answer, ContractInvalid as `connected_vehicle` does."""
    with closing(_link(settings, broker)) as link:
        yield ListenedVehicle(settings, link)


def _link(settings: VehicleSettings, broker: BrokerAccess) -> MessageLink:
    if find_spec("paho") is None:
        raise ContractInvalid(because("extra_not_installed", extra=EXTRA))
    if broker.authority_file and not Path(broker.authority_file).is_file():
        raise ContractInvalid(because("certificate_authority_missing"), where=broker.authority_file)
    from harness.adapters.providers.vda5050.broker import BrokerLink  # noqa: PLC0415  MQTT loads for sites that use it

    return BrokerLink(
        broker.address,
        client_id=f"regen-{settings.name}-{SystemIds().token()[:8]}",
        user=broker.user,
        password=broker.password,
        authority_file=broker.authority_file,
    )
