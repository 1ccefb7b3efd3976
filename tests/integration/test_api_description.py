"""The description of the API is true: requests are made from it, and every answer is held against it."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import hypothesis
import pytest
import schemathesis
from hypothesis import strategies as st
from pydantic import SecretStr
from schemathesis import GenerationMode
from schemathesis.checks import CHECKS, load_all_checks

from app.routes.openapi import PATH
from app.settings import ConsoleSettings
from harness.contracts.maps import AttachCloud, CloudChunk, MapCloud, map_stream
from rsi_reviews.acceptance import accepted
from rsi_reviews.release_service import ReleaseService
from tests.builders.consoles import OWNER, Stand, console_stand
from tests.builders.releases import LAUNCHER, PREDICATE, Bench, candidate, expect

load_all_checks()
BEARER = {"Authorization": f"Bearer {OWNER}"}
SETTINGS = ConsoleSettings(
    port=8000,
    names=("testserver",),
    robots=("vbot-1",),
    owner_token=SecretStr(OWNER),
    password_memory_kib=19456,
    rate_per_s=100_000,
    rate_burst=1_000_000,
)
HELD = (
    "not_a_server_error",
    "status_code_conformance",
    "content_type_conformance",
    "response_headers_conformance",
    "response_schema_conformance",
    "negative_data_rejection",
)
EXAMPLES = 5
ENDLESS = "/api/v1/events"
CHECKED = [CHECKS.get_one(name) for name in HELD]
TOO_LARGE = 413
"""Refused before it is read, which `negative_data_rejection` does not count as a refusal."""


@schemathesis.serializer("audio/wav")
def as_it_is(context: object, value: object) -> bytes:
    """A recording is sent as bytes; what is generated for one is text."""
    return value if isinstance(value, bytes) else str(value).encode()


@pytest.fixture
def stand(tmp_path: Path) -> Iterator[Stand]:
    with console_stand(settings=SETTINGS, folder=tmp_path) as made:
        made.run()
        yield made


@pytest.fixture
def real(stand: Stand) -> dict[str, str]:
    """Names that exist, so that not every answer is a 404."""
    _, handoff_id = stand.handed_off()
    accounts = stand.owner()
    token = accounts.post("/api/v1/tokens", json={"name": "dock", "scopes": ["read"]}).json()
    digest = accounts.get("/api/v1/evidence?kind=image").json()[0]["blob"]
    alerts = stand.app.state.alert_watch
    alerts.step()
    reviewing = Bench(
        stand.harness, ReleaseService(stand.harness.runtime, judge=partial(accepted, predicate=PREDICATE))
    )
    cloud = MapCloud(
        map_version="site-1", frame="map", source="hall.pcd", source_digest=digest, points=1, dropped=0,
        origin_m=(0.0, 0.0, 0.0), low_m=(0.0, 0.0, 0.0), high_m=(1.0, 1.0, 1.0),
        chunks=(CloudChunk(voxel_m=0.0, points=1, blob=digest),),
    )  # fmt: skip
    attach = AttachCloud(actor=LAUNCHER, cloud=cloud, reason="scan")
    expect(stand.harness.runtime.decide([(map_stream("site-1"), attach)]))
    begun = accounts.post("/api/v1/uploads", json={"name": "drive.mcap", "size_bytes": 2}).json()
    upload = f"/api/v1/uploads/{begun['upload_id']}"
    octets = {"content-type": "application/octet-stream"}
    assert accounts.post(f"{upload}?offset=0", content=b"{}", headers=octets).status_code == 200
    replay = accounts.post(f"{upload}/replay", json={}).json()
    return {
        "upload_id": begun["upload_id"],
        "job_id": replay["replay_id"],
        "alert_id": alerts.alerts.all()[0][0],
        "candidate": reviewing.evaluated(candidate()),
        "map_version": "site-1",
        "mission_id": stand.created(),
        "handoff_id": handoff_id,
        "token_id": token["token_id"],
        "digest": digest,
        "name": "root",
        "robot_id": "vbot-1",
    }


@pytest.fixture
def schema(stand: Stand) -> Any:
    """The description without its locks: who may ask is the business of other tests, here everybody holds the key."""
    described = stand.owner().get(PATH).json()
    del described["security"], described["components"]["securitySchemes"]
    loaded = schemathesis.openapi.from_dict(described)
    loaded.app = stand.app
    return loaded


UNERASED = {"GET /api/v1/evidence/{digest}/erasure"}
"""Answers for what was erased; nothing was erased here."""


def exercise(operation: Any, real: dict[str, str], mode: GenerationMode) -> set[int]:
    """Ask an operation EXAMPLES times, hold every answer against its description; which statuses there were."""
    statuses: set[int] = set()

    @hypothesis.seed(1)
    @hypothesis.settings(
        max_examples=EXAMPLES,
        deadline=None,
        database=None,
        suppress_health_check=list(hypothesis.HealthCheck),
        phases=[hypothesis.Phase.generate],
    )
    @hypothesis.given(case=operation.as_strategy(generation_mode=mode), exists=st.booleans())
    def ask(case: Any, exists: bool) -> None:
        if exists and mode is GenerationMode.POSITIVE:
            case.path_parameters.update({name: real.get(name, old) for name, old in case.path_parameters.items()})
        answer = case.call(headers=BEARER)
        statuses.add(answer.status_code)
        unread = answer.status_code == TOO_LARGE
        checks = [one for one, name in zip(CHECKED, HELD, strict=True) if not (unread and name == HELD[-1])]
        case.validate_response(answer, checks=checks, headers=BEARER)

    ask()
    return statuses


@pytest.mark.parametrize("mode", [GenerationMode.POSITIVE, GenerationMode.NEGATIVE], ids=["right", "wrong"])
def test_every_answer_is_as_described_whatever_is_asked(
    schema: Any, real: dict[str, str], mode: GenerationMode
) -> None:
    operations = [found.ok() for found in schema.get_all_operations()]
    asked = {
        one.label: exercise(one, real, mode) for one in operations if one.path != ENDLESS and is_askable(one, mode)
    }
    assert len(asked) >= (24 if mode is GenerationMode.POSITIVE else 15)
    if mode is GenerationMode.POSITIVE:
        unread = [
            label
            for label, statuses in asked.items()
            if label not in UNERASED and label.startswith("GET") and 200 not in statuses
        ]
        assert "\n".join(unread) == ""


def is_askable(operation: Any, mode: GenerationMode) -> bool:
    """What takes nothing at all cannot be asked wrongly."""
    return mode is GenerationMode.POSITIVE or bool(operation.query or operation.body)
