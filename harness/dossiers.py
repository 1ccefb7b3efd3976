"""Exports one mission to one signed file (a dossier), and verifies such a file without a data folder or network."""

import zipfile
from pathlib import Path

from harness.adapters.clock import SystemClock
from harness.adapters.ids import SystemIds
from harness.adapters.stores.dossier import open_dossier, signing_key, write_dossier
from harness.adapters.stores.memory import MemorySpool
from harness.auditing.dossier import DossierVerdict, collect, judge
from harness.bootstrap import NullSignals, Parts, runtime_on
from harness.contracts.dossier import DossierContents
from harness.contracts.errors import DossierInvalid
from harness.contracts.ids import MissionId
from harness.contracts.reasons import because
from harness.runtime import Runtime


def export_dossier(
    runtime: Runtime, mission_id: MissionId, file: Path, *, data: Path, exported_by: str
) -> DossierContents:
    """Write what the log holds of a mission, signed with the key of the data folder.

    Raises UnknownName, StoreUnavailable.
    """
    now_s = SystemClock().now().wall_s
    collected = collect(runtime, mission_id, exported_by=exported_by, exported_at_s=now_s)
    write_dossier(file, collected.contents, collected.files, signing_key(data))
    return collected.contents


def verify_dossier(file: Path, *, key: str = "") -> DossierVerdict:
    """Signature, digests, chain, and every decision derived again. `key`: the public key that must have signed it.

    Raises DossierInvalid or LogDamaged that name what does not hold. Needs no data folder and no network.
    """
    try:
        archive = zipfile.ZipFile(file)
    except (OSError, zipfile.BadZipFile) as error:
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
