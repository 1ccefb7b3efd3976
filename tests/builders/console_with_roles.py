"""Builds a console with a person of every role and valid request bodies for every route, for tests of permissions."""

import re
import zipfile
from dataclasses import dataclass
from io import BytesIO

import yaml
from fastapi.testclient import TestClient
from msgspec import to_builtins
from msgspec.structs import replace

from app.views.uploaded_files import ReplayJob
from harness.conformance.findings import ConformanceFinding, ConformanceResult
from harness.contracts.actors import Actor
from harness.contracts.ids import MissionId
from harness.contracts.values import encode
from tests.builders.consoles import Stand
from tests.builders.people import PASSWORD
from tests.builders.releases import candidate, tried

TURNS = ("claim", "release", "on-my-way", "choose", "ask-colleague", "take-over", "hand-back", "close")
EDITED = ("/routes/", "/own-missions/", "/own-robots/")
"""Pages and addresses under which something of the site is changed by its name."""
ALERT_TURNS = ("acknowledge", "shelve", "suppress", "restore", "assign")
PHOTOGRAPH = b"\xff\xd8\xff a photograph that nothing refers to"
RECORDING = b"{}"
CLOUD = (
    b"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
    b"POINTS 2\nDATA ascii\n0 0 0\n1 1 1\n"
)


def zipped_map() -> bytes:
    """A floor map of four cells, one of them a wall, with its image in one zip."""
    body = BytesIO()
    with zipfile.ZipFile(body, "w") as archive:
        archive.writestr("hall.pgm", b"P5\n2 2\n255\n" + bytes([0, 254, 254, 254]))
        archive.writestr("hall.yaml", "image: hall.pgm\nresolution: 0.5\norigin: [0.0, 0.0, 0.0]\n")
    return body.getvalue()


UPLOADS = {
    "recording": ("drive.mcap", RECORDING),
    "cloud": ("hall.pcd", CLOUD),
    "map": ("hall.zip", zipped_map()),
}
"""Name and bytes of what is uploaded. No test of permissions reads the recording: a replay of it waits."""
REASONED = ("stop", "reason", "pause", "resume", "dispute", "withdraw", "case", "free", "erase", "dismiss")


@dataclass(frozen=True)
class ConsoleWithRoles:
    """A console with a mission that ended, one in progress, a question, and a person of every role."""

    stand: Stand
    people: dict[str, TestClient]
    mission_id: MissionId
    handoff_id: str
    token_id: str
    alert_id: str = "alert_1"
    candidate: str = "none"

    def address(self, path: str) -> str:
        names = {
            "mission_id": self.mission_id,
            "handoff_id": self.handoff_id,
            "token_id": self.token_id,
            "alert_id": self.alert_id,
            "place_id": "office_storage",
            "name": "somebody",
            "robot_id": "vbot-1",
            "digest": self.stand.harness.runtime.keep(PHOTOGRAPH) if path.endswith("/erase") else "0" * 64,
            "position": "1",
            "form": "viser",
            "candidate": self.candidate,
            "verb": "comment",
            "proposal_id": "0" * 16,
            "resource": "vbot-1/mobile_base",
        }
        if self.stand.app.state.console.replays is not None:
            last = path.rpartition("/")[2]
            names |= {"upload_id": self.upload(last if last in ("cloud", "map") else "recording")}
            names |= {"job_id": self.replay()} if "{job_id}" in path else {}
        names |= {"name": self.named(path)} if any(one in path for one in EDITED) else {}
        return re.sub(r"\{(\w+)(:\w+)?\}", lambda found: names.get(found[1], "1"), path)

    def upload(self, kind: str) -> str:
        """A whole upload that no replay reads."""
        console = self.stand.app.state.console
        for one in console.uploads.all():
            if one.kind == kind and one.complete and not console.replays.uses(one.upload_id):
                return str(one.upload_id)
        name, content = UPLOADS[kind]
        begun = console.uploads.begin(name, size_bytes=len(content), by="the-operator")
        return str(console.uploads.add(begun.upload_id, offset=0, piece=content, by="the-operator").upload_id)

    def replay(self) -> str:
        """A replay that was asked for; nothing here runs it."""
        console = self.stand.app.state.console
        for one in console.replays.jobs():
            return str(one.job_id)
        upload = console.uploads.whole(self.upload("recording"))
        job = ReplayJob(
            job_id="replay-1", upload_id=upload.upload_id, name=upload.name, by="the-operator", state="waiting"
        )
        actor = Actor(name="the-operator", role="operator")
        return str(console.replays.ask(job, console.uploads.path(upload), actor).job_id)

    def body(self, path: str) -> dict[str, object]:
        """A valid body for a route that changes something, so that only the permission of the caller decides."""
        handoff = self.stand.harness.runtime.handoff(self.handoff_id)  # type: ignore[arg-type]
        assert handoff.opened is not None
        last = path.rsplit("/", 1)[-1]
        if "/{candidate}/" in path:
            return about_candidate(last)
        if last in ("missions", "preview"):
            return {"template": "circuit", "robot_id": "vbot-1", "goal": "Walk the circuit", "key": "k1"}
        if last == "goal-proposals":
            return {"goal": "Go to the Office storage area"}
        if last == "decision":
            return {
                "decision": "reject",
                "reason": "not safe",
                "key": "k2",
                "cycle": handoff.cycle,
                "subject": handoff.opened.subject,
                "evidence": handoff.opened.evidence,
            }
        if last == "dispute" and not path.startswith("/api/"):
            return {"reason": "because", "from": "report"}
        if path == "/api/v1/places/{place_id}":
            return {"name": "Office", "x_m": 1.0, "y_m": 1.0, "reason": "because"}
        if path == "/api/v1/places/{place_id}/remove":
            return {"basis": 7, "reason": "because"}
        if any(one in path for one in EDITED):
            return self.at_site(path)
        if last in ALERT_TURNS or path.startswith("/places/"):
            return self.looked_after(last)
        if last in (*TURNS, "attest"):
            return self.turn(last, handoff.cycle, api=path.startswith("/api/"))
        if last in ("people", "accounts"):
            return {"name": "newcomer", "roles": ["viewer"], "password": PASSWORD}
        if last in ("candidates", "check"):
            return proposal(api=path.startswith("/api/"))
        if path == "/api/v1/uploads":
            return {"name": "drive.mcap", "size_bytes": len(RECORDING)}
        if path.endswith("/{upload_id}/map"):
            return {"map_version": "hall-9", "frame": "map", "metres_per_cell": 0.5, "reason": "because"}
        if path.endswith("/{upload_id}/cloud"):
            return {"map_version": "site-1", "frame": "map", "metres_per_unit": 1.0, "reason": "because"}
        if last == "cloud":
            corner = [0.0, 0.0, 0.0]
            place = {"origin_m": corner, "low_m": corner, "high_m": corner, "points": 0, "dropped": 0, "chunks": []}
            named = {"map_version": "1", "frame": "map", "source": "a.pcd", "source_digest": "0" * 64}
            return {"cloud": {**named, **place}, "reason": "because"}
        if last == "policy":
            kept = {} if path.startswith("/api/") else {"key": "k4"}
            return {"kind": "two_person", "quorum": 1, "reason": "because", **kept}
        if last == "tokens":
            return {"name": "newcomer", "scopes": ["read"]}
        if last == "{name}":
            return {"roles": ["viewer"]}
        if last == "checks":
            card = next(iter(self.stand.harness.robots.values())).providers()[0].card
            row = ConformanceFinding(row="card", title="Card", outcome="met", text="The card is whole")
            found = ConformanceResult(provider_id=card.provider_id, version=card.version, card=card, findings=(row,))
            return {"address": "http://127.0.0.1:1", "findings": [to_builtins(found)], "reason": "because"}
        if last in ("autonomy", "safe", "stand", "posture", "teleoperation", "wheel", "drive", "turn", "return"):
            return self.at_robot(last)
        return {"reason": "because"} if last in REASONED else {}

    def looked_after(self, last: str) -> dict[str, object]:
        """A valid body for an alert or a place."""
        place = {"name": "Bay", "x": "1", "y": "1", "heading": "0", "verification": "configured", "reason": "because"}
        known: dict[str, dict[str, object]] = {
            "acknowledge": {"seen": 1},
            "shelve": {"reason": "because", "for_s": 900},
            "suppress": {"reason": "because"},
            "assign": {"assignee": "eve"},
            "new": {**place, "place_id": "bay_1"},
            "edit": {**place, "name": "Office", "basis": "0"},
            "remove": {"reason": "because", "basis": "1"},
        }
        return known.get(last, {})

    def named(self, path: str) -> str:
        """A mission of the site's own that names no place, a robot, or a route that no way to safety uses."""
        if "/own-missions/" in path:
            return "camera-report"
        if "/own-robots/" in path:
            return "vbot-2"
        site = self.stand.harness.runtime.site
        authorised = {zone.retreat.route for zone in site.zones if zone.retreat is not None}
        return next(one.name for one in site.routes if one.name not in authorised)

    def at_site(self, path: str) -> dict[str, object]:
        """A valid body for a change of a route, of a mission of the site's own, or of a robot."""
        last, form = path.rpartition("/")[2], not path.startswith("/api/")
        if last == "remove":
            return {"basis": "1" if form else 7, "reason": "because"}
        runtime, known = self.stand.harness.runtime, self.named(path)
        named = "lane-1" if last == "new" else known
        if "/own-robots/" in path:
            named = "vbot-9" if last == "new" else "vbot-2"
            return {"text": f"name: {named}\nkind: simulator\n", "reason": "because"}
        if "/own-missions/" in path:
            template = next(one for one in runtime.beside if one.name == known)
            return {"text": yaml.safe_dump(to_builtins(replace(template, name=named))), "reason": "because"}
        start, end = runtime.site.places[:2]
        ends: dict[str, object] = {"start": start.place_id, "end": end.place_id, "reason": "because"}
        drawn = (start.approach_m, end.approach_m)
        if form:
            return ends | {"name": named, "waypoints": "; ".join(f"{x}, {y}" for x, y in drawn), "basis": "0"}
        return ends | {"waypoints_m": [list(one) for one in drawn]}

    def at_robot(self, last: str) -> dict[str, object]:
        """A valid body for a request to a robot."""
        known: dict[str, dict[str, object]] = {
            "autonomy": {"autonomy": "manual", "reason": "because"},
            "posture": {"posture": "standing", "reason": "because"},
            "turn": {"session": "s", "v_mps": 0.1},
        }
        return known.get(last, {"reason": "because"})

    def turn(self, last: str, cycle: int, *, api: bool) -> dict[str, object]:
        """A valid body for a request at a handoff."""
        known: dict[str, dict[str, object]] = {
            "on-my-way": {"reason": "because"},
            "ask-colleague": {"reason": "because"},
            "choose": {"action": "retry", "cycle": cycle},
            "take-over": {"claim": "t", "device": "desk", "key": "k", "reason": "because"},
            "hand-back": {"claim": "t", "key": "k", "reason": "because"},
            "close": {"claim": "t", "key": "k", "reason": "because"},
            "attest": {"condition_id": "c", "statement" if api else "reason": "because", "key": "k", "cycle": cycle},
        }
        return known.get(last, {"claim": "t"})

    def send(self, who: str, method: str, path: str) -> int:
        client, address, body = self.people[who], self.address(path), dict(self.body(path))
        if method == "GET":
            return client.get(address).status_code
        if path == "/recordings":
            return client.request(method, address, files={"file": UPLOADS["recording"]}).status_code
        if path == "/api/v1/uploads/{upload_id}" and method == "POST":
            octets = {"content-type": "application/octet-stream"}
            return client.post(f"{address}?offset=0", content=RECORDING, headers=octets).status_code
        if path.startswith("/api/") or path.endswith("/turn"):
            body.pop("key", None) if path.endswith(("/missions", "/preview")) else None
            return client.request(method, address, json=body).status_code
        return client.request(method, address, data=body).status_code


def about_candidate(verb: str) -> dict[str, object]:
    """A valid body for an act on a candidate that is no longer what was shown."""
    if verb in ("evaluate", "cancel-evaluation"):
        return {}
    seen = {"cycle": 1, "subject": "0" * 64}
    known: dict[str, dict[str, object]] = {
        **dict.fromkeys(("request-changes", "request_changes", "approve", "reject", "authorise"), seen),
        "release": {**seen, "robot_id": "vbot-1"},
        "adjudicate": {"mission_id": "m", "finding": "sound"},
    }
    return {"reason": "because", "key": f"k3-{verb}", **known.get(verb, {})}


def proposal(*, api: bool) -> dict[str, object]:
    """A valid candidate, as the form or the API takes it."""
    if api:
        made = candidate(tried(wait_s=7.0))
        return {"configuration": encode(made.configuration).decode(), "manifest": encode(made.manifest).decode()}
    manifest = {"reason": "because", "intended_effect": "less waiting", "metric": "recovery_cost"}
    return {**manifest, "smallest_effect": "0.1", "by": "fields", "recovery.wait_s": "8"}


def routes(stand: Stand) -> list[tuple[str, str]]:
    """(method, path) of every route of the running application."""
    found = []
    for route in stand.app.routes:
        for inner in getattr(getattr(route, "original_router", None), "routes", [route]):
            methods = getattr(inner, "methods", None) or set()
            found += [(method, inner.path) for method in sorted(methods) if method not in ("HEAD", "OPTIONS")]
    return found
