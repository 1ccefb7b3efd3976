"""Labels of the 3D view: what stands close together is drawn one above the other, and a zone gives way to a place."""

from collections.abc import Iterator

import pytest
import viser

from app.scene.drawing import LABEL_STEP_M, LABELS_APART_M, Drawing

ROOM = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    made = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield made
    made.stop()


def labels(server: viser.ViserServer) -> dict[str, float]:
    """Text and height of every label."""
    handles = server.scene._handle_from_node_name.values()
    return {one.text: float(one.position[2]) for one in handles if isinstance(one, viser.LabelHandle)}


def test_places_that_are_close_have_their_labels_one_above_the_other(server: viser.ViserServer) -> None:
    drawing = Drawing(server, origin_m=(0.0, 0.0))
    drawing.anchor("dock", (0.0, 0.0))
    drawing.anchor("rack", (LABELS_APART_M - 0.1, 0.0))
    drawing.anchor("door", (0.0, LABELS_APART_M + 0.1))
    drawing.anchor("dock", (0.0, 0.0))
    found = labels(server)
    assert found["rack"] == pytest.approx(found["door"] + LABEL_STEP_M) == pytest.approx(found["dock"] + LABEL_STEP_M)


def test_a_zone_is_not_named_where_a_label_stands_and_a_forbidden_one_always_is(server: viser.ViserServer) -> None:
    drawing = Drawing(server, origin_m=(0.0, 0.0))
    drawing.anchor("shelf", (2.0, 2.5))
    drawing.forbidden("pit", ROOM)
    drawing.part_of_site("storage", "zone", ROOM)
    drawing.part_of_site("office", "zone", [(x + 10.0, y) for x, y in ROOM])
    assert set(labels(server)) == {"shelf", "keep out: pit", "office"}
