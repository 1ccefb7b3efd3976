"""The JSON Schemas that are published of stored values, by name and version, so that other programs can read them.

A version stays as it is: a field that is added is optional, and a change that breaks a reader is a new version beside
the old one.
"""

import json
from typing import Any

import msgspec

from harness.contracts.dossier import DossierContents
from harness.contracts.evidence import EvidencePacket
from harness.contracts.tasks import TaskContract
from harness.contracts.verdicts import GoalVerdict, NodeVerdict

VERSION = 1
DIALECT = "https://json-schema.org/draft/2020-12/schema"
PUBLISHED: dict[str, tuple[type, str]] = {
    "evidence-packet": (EvidencePacket, "What one execution left behind: identity, evidence, declarations, proposals"),
    "node-verdict": (NodeVerdict, "The verifier's verdict on one packet, condition by condition"),
    "goal-verdict": (GoalVerdict, "The verdict on the original completion conditions of a mission"),
    "task-contract": (TaskContract, "A compiled request: goal, graph, conditions, constraints, recovery budgets"),
    "dossier-contents": (DossierContents, "The manifest of a signed mission dossier (dossier.json)"),
}


def schema_files() -> dict[str, bytes]:
    """Every schema by its file name, as it is published: keys in order, two spaces, a line feed at the end."""
    return {f"{name}.v{VERSION}.schema.json": _file(name, *PUBLISHED[name]) for name in PUBLISHED}


def _file(name: str, kind: type, title: str) -> bytes:
    schema: dict[str, Any] = {
        "$schema": DIALECT,
        "$id": f"urn:regenharness:schema:{name}:{VERSION}",
        "title": title,
        **msgspec.json.schema(kind),
    }
    return (json.dumps(schema, indent=2, sort_keys=True, ensure_ascii=False) + "\n").encode()
