"""The model port against endpoints on loopback: good, slow, broken and hostile; and recorded exchanges."""

import json
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from harness.adapters.models.chat import ChatModel
from harness.adapters.models.http_transport import ANSWER_BYTES, HttpChatTransport
from harness.adapters.stores.memory import MemoryBlobStore
from harness.contracts.errors import ModelAnswerInvalid, ModelFailed, ModelUnreachable
from harness.contracts.ids import Digest
from harness.contracts.models import MessageImage, ModelExchange, question
from harness.contracts.reasons import Reason
from harness.contracts.values import Value, decode
from harness.workspace.files import ModelEntry, ModelsFile, SecretReference
from harness.workspace.model_ports import open_models
from tests.builders.model_endpoint import ModelServer, completion, serving_model
from tests.fakes.models import RecordedTransport, recorded_answers


class Colour(Value):
    """The shape that these tests ask for."""

    colour: str
    share: float


GOOD = '{"colour": "red", "share": 0.5}'
ASK = question("planner", instructions="Name a colour.", text="The door.")


def port(server: ModelServer, blobs: MemoryBlobStore, **settings: Any) -> ChatModel:
    endpoint = server.endpoint(**settings)
    transport = HttpChatTransport(endpoint.base_url, "secret-key", endpoint.timeout_s)
    return ChatModel(endpoint, transport, keep=blobs.put, read=blobs.get)


def refusal(server: ModelServer, **settings: Any) -> tuple[type[ModelFailed], str, ModelExchange | None]:
    """Which error, by which rule, and the exchange that was recorded."""
    blobs = MemoryBlobStore()
    with pytest.raises(ModelFailed) as caught:
        port(server, blobs, **settings).ask(ASK, Colour)
    digest = caught.value.exchange
    return type(caught.value), caught.value.reason.code, decode(blobs.get(digest), ModelExchange) if digest else None


def test_an_answer_of_the_asked_shape_comes_with_its_cost_and_record() -> None:
    blobs = MemoryBlobStore()
    price = {"currency": "EUR", "input_per_million": 1e6, "output_per_million": 2e6}
    with serving_model(lambda request: GOOD) as server:
        entry = decode(
            json.dumps({"name": "small", "base_url": server.url, "model": "small-1", "price": price}).encode(),
            ModelEntry,
        )
        reply = port(server, blobs, price=entry.price).ask(ASK, Colour)
        assert reply.value == Colour(colour="red", share=0.5)
        assert server.keys == ["Bearer secret-key"]
        schema = server.asked[0]["response_format"]["json_schema"]
        assert schema["strict"] is True and schema["schema"]["$defs"]["Colour"]["additionalProperties"] is False
    record = decode(blobs.get(reply.digest), ModelExchange)
    assert record == reply.exchange
    assert (record.input_tokens, record.output_tokens, record.currency) == (10, 5, "EUR")
    assert record.cost == pytest.approx(10 * 1 + 5 * 2) and record.seconds > 0 and record.attempts == 1
    assert json.loads(blobs.get(record.request))["messages"][1]["content"] == "The door."
    assert record.answer is not None and b"red" in blobs.get(record.answer)
    assert all(b"secret-key" not in blobs.get(digest) for digest in blobs.digests())


@pytest.mark.parametrize(
    ("said", "rule"),
    [
        ("The Lazy Robot", "model_answer_not_json"),
        ('{"colour": "red"}', "model_answer_misshapen"),
        ('{"colour": "red", "share": "half"}', "model_answer_misshapen"),
        ('{"colour": "red", "share": 0.5, "commit": true}', "model_answer_misshapen"),
        (completion(GOOD, finish="length"), "model_answer_cut_off"),
        (completion(""), "model_answer_empty"),
        ({"choices": []}, "model_answer_empty"),
        (b"<html>login</html>", "model_speaks_other_protocol"),
        ("[" * 60 + "]" * 60, "model_answer_nested"),
        (b"[" * 100_000, "model_answer_nested"),
        ('{"colour": "' + "r" * 70_000 + '", "share": 0.5}', "model_answer_too_long"),
    ],
)
def test_an_answer_of_another_shape_is_refused_by_rule_and_recorded(said: Any, rule: str) -> None:
    with serving_model(lambda request: said) as server:
        kind, code, record = refusal(server)
    assert kind is ModelAnswerInvalid and code == rule
    assert record is not None and isinstance(record.refused, Reason) and record.refused.code == rule
    assert record.answer is not None


def test_a_huge_answer_is_not_read_to_its_end() -> None:
    with serving_model(lambda request: b" " * (ANSWER_BYTES * 40)) as server:
        kind, code, record = refusal(server)
    assert kind is ModelUnreachable and code == "model_answer_too_large"
    assert record is not None and record.answer is None


def test_an_endless_stream_ends_with_the_time_limit() -> None:
    with serving_model(lambda request: GOOD) as server:
        server.endless = True
        began_s = time.monotonic()
        kind, code, _ = refusal(server, timeout_s=0.3, retries=5)
        assert time.monotonic() - began_s < 3.0
    assert kind is ModelUnreachable and code == "model_gave_no_answer"


def test_a_slow_endpoint_is_given_up_within_one_time_limit_for_all_attempts() -> None:
    with serving_model(lambda request: GOOD) as server:
        server.delay_s = 5.0
        began_s = time.monotonic()
        kind, _, record = refusal(server, timeout_s=0.4, retries=3)
        assert time.monotonic() - began_s < 3.0
    assert kind is ModelUnreachable and record is not None and record.seconds < 3.0


def test_a_redirect_is_not_followed() -> None:
    with serving_model(lambda request: GOOD) as target, serving_model(lambda request: GOOD) as server:
        server.redirect = f"{target.url}/chat/completions"
        kind, code, _ = refusal(server, retries=2)
        assert kind is ModelUnreachable and code == "model_redirects"
        assert len(server.asked) == 1 and target.asked == []


def test_an_overloaded_endpoint_is_asked_again_and_a_refusing_one_is_not() -> None:
    with serving_model(lambda request: 503) as server:
        server.answer = lambda request: GOOD if len(server.asked) > 1 else 503
        reply = port(server, MemoryBlobStore(), retries=1).ask(ASK, Colour)
        assert reply.exchange.attempts == 2 and len(server.asked) == 2
    with serving_model(lambda request: 401) as server:
        kind, code, _ = refusal(server, retries=3)
        assert kind is ModelUnreachable and code == "model_answers_status" and len(server.asked) == 1


def test_nobody_at_the_address_is_a_typed_refusal() -> None:
    with serving_model(lambda request: GOOD) as server:
        pass
    kind, code, record = refusal(server)
    assert kind is ModelUnreachable and code == "model_gave_no_answer" and record is not None


def test_the_cost_limit_ends_the_asking_and_figures_that_cannot_be_true_are_not_believed() -> None:
    from_nobody = completion(GOOD, tokens=(-5, 10**12))
    price = {"output_per_million": 1e6, "limit": 1.0}
    with serving_model(lambda request: from_nobody) as server:
        entry = decode(
            json.dumps({"name": "a", "base_url": server.url, "model": "m", "price": price}).encode(), ModelEntry
        )
        model = port(server, MemoryBlobStore(), price=entry.price)
        first = model.ask(ASK, Colour)
        assert (first.exchange.input_tokens, first.exchange.output_tokens) == (None, None) and first.exchange.cost > 0
        with pytest.raises(ModelFailed) as caught:
            model.ask(ASK, Colour)
        assert caught.value.reason.code == "model_cost_limit_reached" and len(server.asked) == 1


def test_an_image_is_sent_as_bytes_and_recorded_by_its_digest() -> None:
    blobs = MemoryBlobStore()
    image = blobs.put(b"\xff\xd8 a picture")
    asked = question("description", instructions="Describe.", text="", images=(MessageImage(digest=image),))
    with serving_model(lambda request: GOOD) as server:
        reply = port(server, blobs, images=True).ask(asked, Colour)
        sent = server.asked[0]["messages"][1]["content"][1]["image_url"]["url"]
        assert sent.startswith("data:image/jpeg;base64,")
        assert f"sha256:{image}".encode() in blobs.get(reply.exchange.request)
        assert b"base64" not in blobs.get(reply.exchange.request)
        with pytest.raises(ModelFailed) as caught:
            port(server, blobs, images=False).ask(asked, Colour)
        assert caught.value.reason.code == "model_takes_no_images" and len(server.asked) == 1


def test_a_recorded_exchange_gives_the_same_answer_again_and_no_other() -> None:
    blobs = MemoryBlobStore()
    with serving_model(lambda request: GOOD) as server:
        endpoint = server.endpoint()
        live = port(server, blobs).ask(ASK, Colour)
    replayed = ChatModel(
        endpoint,
        RecordedTransport(recorded_answers([live.exchange], read=blobs.get)),
        keep=blobs.put,
        read=blobs.get,
    )
    assert replayed.ask(ASK, Colour).value == live.value
    with pytest.raises(ModelUnreachable) as caught:
        replayed.ask(question("planner", instructions="Name a colour.", text="The wall."), Colour)
    assert caught.value.reason.code == "model_exchange_unrecorded"


@pytest.mark.parametrize("answers", ["json_object", "text"])
def test_an_endpoint_without_schemas_is_told_the_shape_and_checked_all_the_same(answers: str) -> None:
    said = GOOD if answers == "json_object" else f"Sure!\n```json\n{GOOD}\n```"
    with serving_model(lambda request: said) as server:
        assert port(server, MemoryBlobStore(), answers=answers).ask(ASK, Colour).value.colour == "red"
        assert "JSON schema" in server.asked[0]["messages"][0]["content"]
        server.answer = lambda request: '{"colour": 1}'
        with pytest.raises(ModelAnswerInvalid):
            port(server, MemoryBlobStore(), answers=answers).ask(ASK, Colour)


def test_the_roles_of_a_folder_share_one_port_for_each_model(tmp_path: Path) -> None:
    (tmp_path / "key").write_text("from-the-file\n")
    blobs = MemoryBlobStore()
    with serving_model(lambda request: GOOD) as server, ExitStack() as stack:
        entry = ModelEntry(name="small", base_url=server.url, model="small-1", key=SecretReference(file="key"))
        file = ModelsFile(models=(entry,), roles={"planner": "small", "diagnosis": "small"})
        opened = open_models(file, tmp_path, stack=stack, keep=blobs.put, read=blobs.get)
        assert opened["planner"] is opened["diagnosis"] and set(opened) == {"planner", "diagnosis"}
        opened["planner"].ask(ASK, Colour)
        assert server.keys == ["Bearer from-the-file"] and opened["planner"].name == "small (small-1)"


def test_a_missing_image_is_not_asked_about() -> None:
    blobs = MemoryBlobStore()
    asked = question("description", instructions="", text="", images=(MessageImage(digest=Digest("0" * 64)),))
    with serving_model(lambda request: GOOD) as server:
        with pytest.raises(ModelFailed):
            port(server, blobs, images=True).ask(asked, Colour)
        assert server.asked == []
