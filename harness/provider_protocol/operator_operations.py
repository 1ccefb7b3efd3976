"""Optional operations of a robot for people, beside the provider protocol: live camera, teleoperation, posture."""

from harness.contracts import protocol
from harness.contracts.ports import LiveCamera, Teleoperable
from harness.provider_protocol.operations import Names, Operation
from harness.provider_protocol.wire import DriveSession


def camera_operations(camera: LiveCamera) -> tuple[Operation, ...]:
    """The live camera. It runs on its own thread: nothing waits for a picture."""

    def picture(names: Names, body: None) -> protocol.Picture:
        return camera.picture()

    return (
        Operation("GET", "/camera", "What the camera sees now; no evidence", protocol.Picture, picture, apart=True),
    )


def hand_operations(hand: Teleoperable) -> tuple[Operation, ...]:
    """Driving by hand and posture, both fenced by the token of the base's lease."""

    def drive(names: Names, body: protocol.DriveOrder) -> protocol.DriveReport:
        return hand.drive(body)

    def release(names: Names, body: DriveSession) -> protocol.DriveReport:
        return hand.release(body.session)

    def rest(names: Names, body: protocol.PostureOrder) -> protocol.RobotStatus:
        return hand.rest(body)

    return (
        Operation(
            "POST",
            "/hand/drive",
            "Hold a velocity until the next order",
            protocol.DriveReport,
            drive,
            body=protocol.DriveOrder,
        ),
        Operation("POST", "/hand/release", "End driving by hand", protocol.DriveReport, release, body=DriveSession),
        Operation(
            "POST", "/hand/posture", "Lie down or stand up", protocol.RobotStatus, rest, body=protocol.PostureOrder
        ),
    )
