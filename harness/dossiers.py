"""Exports one mission to one signed file (a dossier), and verifies such a file without a data folder or network."""

import zipfile
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from harness.adapters.clock import SystemClock
from harness.adapters.ids import SystemIds
from harness.adapters.limited_process import Limits, run_limited
from harness.adapters.stores.dossier import open_dossier, signing_key, write_dossier
from harness.adapters.stores.memory import MemorySpool
from harness.auditing.dossier import DossierVerdict, collect, judge
from harness.bootstrap import NullSignals, Parts, runtime_on
from harness.contracts.dossier import DossierContents
from harness.contracts.errors import DossierInvalid
from harness.contracts.ids import MissionId
from harness.contracts.reasons import because
from harness.contracts.values import Value, decode, encode
from harness.runtime import Runtime

LIMITS = Limits(memory_bytes=256 * 2**20, cpu_s=300.0, wall_s=900.0, output_bytes=16 * 2**20)
"""For the check of one dossier; a mission of seven stages takes a few seconds and 20 MiB of it."""


def export_dossier(
    runtime: Runtime,
    mission_id: MissionId,
    file: Path,
    *,
    data: Path,
    exported_by: str,
    attached: Mapping[str, bytes] = MappingProxyType({}),
) -> DossierContents:
    """Write what the log holds of a mission, signed with the key of the data folder; `attached` as in `collect`.

    Raises UnknownName, StoreUnavailable.
    """
    now_s = SystemClock().now().wall_s
    collection = collect(runtime, mission_id, exported_by=exported_by, exported_at_s=now_s, attached=attached)
    write_dossier(file, collection.contents, collection.files, signing_key(data))
    return collection.contents


class DossierCheck(Value):
    """What the process that checks a dossier is asked."""

    file: str
    key: str


def verify_dossier(file: Path, *, key: str = "") -> DossierVerdict:
    """Signature, digests, chain, and every decision derived again. `key`: the public key that must have signed it.

    Anybody may have made the file: it is read in a process with limits. Raises DossierInvalid or LogDamaged that name
    what does not hold. Needs no data folder and no network.
    """
    request = encode(DossierCheck(file=str(file.absolute()), key=key))
    answer = run_limited(checked, request, LIMITS, failure=DossierInvalid, where=str(file))
    return decode(answer, DossierVerdict)


def checked(request: bytes) -> bytes:
    """The verdict on a dossier, in this very process. Raises DossierInvalid, LogDamaged."""
    check = decode(request, DossierCheck)
    return encode(_verdict(Path(check.file), key=check.key))


def _verdict(file: Path, *, key: str) -> DossierVerdict:
    try:
        archive = zipfile.ZipFile(file)
    except (OSError, zipfile.BadZipFile, RuntimeError, ValueError) as error:
        raise DossierInvalid(because("dossier_unreadable", error=str(error)), where=str(file)) from error
    with archive:
        dossier = open_dossier(archive, where=str(file))
        if key and key != dossier.public_key:
            raise DossierInvalid(because("dossier_other_key", public_key=dossier.public_key), where=str(file))
        parts = Parts(
            store=dossier.log,
            blobs=dossier.blobs,
            spool=MemorySpool(),
            ids=SystemIds(),
            clock=SystemClock(),
            signals=NullSignals(),
        )
        return judge(runtime_on(parts), dossier.contents, public_key=dossier.public_key, trusted=bool(key))
