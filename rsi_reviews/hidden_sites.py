"""Reads sites from files: what recurs at a place, phase by phase, and what an expert who knows it would change.

A site is named in a case as `name`, or as `name@fleet.generation`: then shares and durations differ a little from fleet
to fleet, and the phase is the one of that generation. Anybody can add one: a YAML file in `rsi_reviews/sites`.
"""

import hashlib
from functools import lru_cache
from importlib.resources import files
from typing import Annotated, Literal

import msgspec
from msgspec.structs import replace

from harness.contracts import values
from harness.contracts.configuration import FailureClass, RecoveryAction
from harness.contracts.errors import UnknownName
from harness.contracts.reasons import because
from harness.contracts.regularities import HiddenSite, Regularity
from harness.workspace.contract_yaml import read_yaml

FOLDER = "rsi_reviews"
SHARE_JITTER, TIME_JITTER = 0.15, 0.05


class Expert(values.Value):
    """What a person who knows the site would change in H: single parameters, and the reason."""

    why: values.Name
    ladders: dict[FailureClass, tuple[RecoveryAction, ...]] = msgspec.field(default_factory=dict)
    wait_s: values.Positive | None = None
    routing: dict[str, values.NonNegative] = msgspec.field(default_factory=dict)
    timeouts_s: dict[str, dict[str, values.Positive]] = msgspec.field(default_factory=dict)


class Phase(values.Value):
    """The site from one generation on."""

    from_generation: values.Count
    regularities: tuple[Regularity, ...]
    expert: Expert | None = None


class SiteFile(values.Value):
    """One site. `kind`: regular, none (nothing recurs), or drifting (what recurs changes)."""

    name: values.Name
    title: values.Name
    kind: Literal["regular", "none", "drifting"]
    phases: Annotated[tuple[Phase, ...], msgspec.Meta(min_length=1)]

    def phase(self, generation: int) -> Phase:
        """The phase of a generation; the first phase before any begins."""
        active = [phase for phase in self.phases if phase.from_generation <= generation]
        return active[-1] if active else self.phases[0]


def site_names(folder: str = "sites") -> tuple[str, ...]:
    """Names of the site files in one folder of this package, in order."""
    found = files(FOLDER).joinpath(folder).iterdir()
    return tuple(sorted(entry.name.removesuffix(".yaml") for entry in found if entry.name.endswith(".yaml")))


@lru_cache(maxsize=64)
def site_file(name: str) -> SiteFile:
    """One site, or `blind/name`. Raises UnknownName that lists the sites, ContractInvalid for a file with an error."""
    folder, _, plain = f"sites/{name}".rpartition("/")
    if plain not in site_names(folder):
        raise UnknownName(because("unknown_hidden_site", name=name, known=tuple(site_names())), where="sites")
    text = files(FOLDER).joinpath(folder, f"{plain}.yaml").read_text(encoding="utf-8")
    return read_yaml(text, SiteFile, where=f"rsi_reviews/{folder}/{plain}.yaml")


def hidden_site(text: str) -> HiddenSite:
    """The site as the simulated world needs it, equal in all generations of one phase.

    Raises UnknownName or ContractInvalid.
    """
    name, _, rest = text.partition("@")
    fleet, _, generation = rest.partition(".")
    if rest and not (fleet.isdigit() and generation.isdigit()):
        raise UnknownName(because("hidden_site_unreadable", text=text), where="sites")
    phase = site_file(name).phase(int(generation or 0))
    regularities = tuple(_jittered(one, fleet) if fleet else one for one in phase.regularities)
    named = f"{name}@{fleet}.{phase.from_generation}" if fleet else name
    return HiddenSite(name=named, regularities=regularities)


def _jittered(one: Regularity, fleet: str) -> Regularity:
    share = one.share * (1.0 + SHARE_JITTER * _between(fleet, one.name, "share"))
    lasts_s = one.lasts_s and one.lasts_s * (1.0 + TIME_JITTER * _between(fleet, one.name, "lasts"))
    return replace(one, share=min(1.0, share), lasts_s=lasts_s)


def _between(*key: str) -> float:
    """From -1 to 1, determined by the key alone."""
    number = int.from_bytes(hashlib.sha256("\n".join(key).encode()).digest()[:8])
    return 2.0 * number / 2**64 - 1.0
