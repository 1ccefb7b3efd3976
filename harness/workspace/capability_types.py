"""Reads capability types: those that ship, and the capabilities.yaml of a site's own folder."""

from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from harness.contracts.capabilities import CapabilityType, Vocabulary
from harness.contracts.values import Value
from harness.workspace.contract_yaml import read_yaml

CAPABILITIES = "capabilities.yaml"


class CapabilitiesFile(Value):
    """capabilities.yaml."""

    capabilities: tuple[CapabilityType, ...] = ()


@lru_cache(maxsize=1)
def shipped_vocabulary() -> Vocabulary:
    """The types that ship, read once."""
    text = files("harness.baseline").joinpath(CAPABILITIES).read_text(encoding="utf-8")
    return Vocabulary(read_yaml(text, CapabilitiesFile, where=f"baseline/{CAPABILITIES}").capabilities)


def with_own(types: tuple[CapabilityType, ...]) -> Vocabulary:
    """The shipped types and a site's own."""
    return Vocabulary((*shipped_vocabulary().types, *types))


def has_capabilities(folder: Path) -> bool:
    """Whether a site declares types of its own."""
    return (folder / CAPABILITIES).exists()
