"""A mission's dossier: every decision about it and what it was based on, in one signed file."""

from harness.contracts.ids import Digest, MissionId, RobotId
from harness.contracts.ports import LogHead
from harness.contracts.values import Count, Value

FORMAT = "regenharness-dossier/1"
CONTENTS, SIGNATURE, EVENTS, RECORDS = "dossier.json", "signature.json", "events.jsonl", "records.jsonl"


class DossierContents(Value):
    """What the signature covers. `files` maps every other name in the file to its SHA-256.

    `absent` lists evidence that packets cite and that was missing or damaged when the dossier was written. `head` is
    the log's head at that time: the anchor to compare with a copy stored elsewhere.
    """

    format: str
    mission_id: MissionId
    robot_id: RobotId
    goal: str
    status: str
    configuration: Digest
    exported_by: str
    exported_at_s: float
    head: LogHead
    events: Count
    records: Count
    files: dict[str, Digest]
    absent: tuple[Digest, ...]


class DossierSignature(Value):
    """Ed25519 over the bytes of `dossier.json`. Keys and signatures in hexadecimal."""

    algorithm: str
    public_key: str
    signature: str
