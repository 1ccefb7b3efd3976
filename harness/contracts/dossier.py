"""A mission's dossier: every decision about it and what it was based on, in one signed file."""

import msgspec

from harness.contracts.ids import ConditionId, Digest, MissionId, RobotId
from harness.contracts.ports import LogHead
from harness.contracts.reasons import Explanation
from harness.contracts.spoken_goals import SpokenGoal
from harness.contracts.values import Count, Name, Value
from harness.contracts.verdicts import Verdict

FORMAT = "regenharness-dossier/1"
CONTENTS, SIGNATURE, EVENTS, RECORDS = "dossier.json", "signature.json", "events.jsonl", "records.jsonl"
REPORT = "report.pdf"
"""For people: signed with the rest; nothing is derived from it."""


class JudgedCondition(Value):
    """One condition of the goal as it was last tested; all but its name and text are unset before any test."""

    condition_id: ConditionId
    text: Name
    verdict: Verdict | None = None
    independence: Count | None = None
    required_independence: Count | None = None
    evidence: tuple[Digest, ...] = ()


class JudgedClause(Value):
    """One clause by its number, or one default of the mission profile; `verdict` is the strictest of its conditions."""

    clause: Name
    told: Explanation
    verdict: Verdict | None
    conditions: tuple[JudgedCondition, ...]


class JudgedGoal(Value):
    """What a mission was for, the text it was read from, and the verdict by clause (D44).

    `digest` is that of the reading; `verdict` is None where the goal was never tested.
    """

    reading: Explanation
    source: str
    digest: Digest
    verdict: Verdict | None
    clauses: tuple[JudgedClause, ...]


class DossierContents(Value):
    """What the signature covers. `files` maps every other name in the file to its SHA-256.

    `goal` is the source text. `judged` is unset for a mission without a reading, and in dossiers of earlier releases.
    `spoken`: the recording and the transcript that the source text is from, both in the file.

    `absent` lists evidence that was missing or damaged when the dossier was written: what packets cite, and what a
    context, a recognition or a lidar look cites in turn. `erased` lists voice and photographs that were erased before;
    their tombstones are among the events. `head` is the log's head at that time: the anchor to compare with a copy
    stored elsewhere.
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
    judged: JudgedGoal | msgspec.UnsetType = msgspec.UNSET
    spoken: SpokenGoal | msgspec.UnsetType = msgspec.UNSET
    erased: tuple[Digest, ...] | msgspec.UnsetType = msgspec.UNSET


class DossierSignature(Value):
    """Ed25519 over the bytes of `dossier.json`. Keys and signatures in hexadecimal."""

    algorithm: str
    public_key: str
    signature: str
