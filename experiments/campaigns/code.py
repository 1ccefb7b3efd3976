"""Says which code a campaign tried: one digest over the sources. Reads files and runs nothing."""

from experiments.campaigns.regen import ROOT
from harness.contracts.ids import Digest, sha256

FOLDERS = ("experiments/campaigns", "harness", "simulator")
SUFFIXES = (".py", ".yaml")


def code_digest(*more: str) -> Digest:
    """The SHA-256 of the sources, in order of their paths: harness with its baseline, simulator, campaigns, and `more`
    folders. A run asks before it begins, so that the answer is about what it loads.
    """
    files = sorted(
        path for folder in (*FOLDERS, *more) for path in (ROOT / folder).rglob("*") if path.suffix in SUFFIXES
    )
    return sha256(b"".join(path.read_bytes() for path in files))
