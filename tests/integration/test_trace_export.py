"""Ended missions are sent as OpenTelemetry traces to a receiver, once, and again only where it was away."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest

from app.background.mission_history import Histories
from app.background.trace_export import TraceExport, otlp_exporter
from app.views.traces import trace_id
from tests.builders.consoles import Stand, console_stand


@dataclass
class Receiver:
    """A small OTLP/HTTP receiver. `status` is what it answers; `spans` are those that it took."""

    address: str = ""
    status: int = 200
    spans: list[dict[str, object]] = field(default_factory=list)

    def take(self, body: bytes) -> None:
        for resource in ExportTraceServiceRequest.FromString(body).resource_spans:
            for scope in resource.scope_spans:
                self.spans += [
                    {
                        "trace": int.from_bytes(one.trace_id, "big"),
                        "id": one.span_id,
                        "parent": one.parent_span_id,
                        "name": one.name,
                        "error": one.status.code == 2,
                        "lasts": one.end_time_unix_nano - one.start_time_unix_nano,
                        "status": next((a.value.string_value for a in one.attributes if a.key == "regen.status"), ""),
                    }
                    for one in scope.spans
                ]


@contextmanager
def receiver() -> Iterator[Receiver]:
    made = Receiver()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["content-length"]))
            if made.status == 200:
                made.take(body)
            self.send_response(made.status)
            self.send_header("content-length", "0")
            self.end_headers()

        def log_message(self, *words: object) -> None:
            return None

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    made.address = f"http://127.0.0.1:{server.server_address[1]}/v1/traces"
    try:
        yield made
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def export(stand: Stand, into: Receiver, folder: Path) -> TraceExport:
    runtime = stand.harness.runtime
    return TraceExport(
        otlp_exporter(into.address), Histories(runtime).of, runtime.head, runtime.log, folder / "traces.json"
    )


def test_an_ended_mission_is_one_trace_of_its_stages_and_invocations(tmp_path: Path) -> None:
    with console_stand() as stand, receiver() as into, closing(export(stand, into, tmp_path)) as traces:
        mission = stand.run()
        waiting, _ = stand.handed_off()
        traces.step()
        assert {one["trace"] for one in into.spans} == {trace_id(mission.mission_id)}
        (root,) = [one for one in into.spans if not one["parent"]]
        assert (root["name"], root["status"], root["error"]) == ("mission", "succeeded", False)
        stages = [one for one in into.spans if one["parent"] == root["id"]]
        assert {one["name"] for one in stages} == {f"stage {name}" for name in mission.nodes}
        invocations = [one for one in into.spans if one["parent"] in {stage["id"] for stage in stages}]
        assert len(invocations) + len(stages) + 1 == len(into.spans)
        assert all(int(str(one["lasts"])) >= 0 for one in into.spans)
        assert trace_id(waiting.mission_id) not in {one["trace"] for one in into.spans}


def test_a_mission_is_sent_once_and_after_a_receiver_was_away(tmp_path: Path) -> None:
    with console_stand() as stand, receiver() as into:
        stand.run()
        into.status = 400
        with closing(export(stand, into, tmp_path)) as traces:
            traces.step()
            assert into.spans == []
            into.status = 200
            traces.step()
        sent = len(into.spans)
        assert sent > 0
        with closing(export(stand, into, tmp_path)) as started_again:
            started_again.step()
        assert len(into.spans) == sent
