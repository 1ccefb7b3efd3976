"""Labels of the 3D view that would cover each other stand at different heights."""

from contextlib import closing
from types import SimpleNamespace

import viser

from app.scene.drawing import LABEL_HEIGHT_M, Drawing


def test_labels_near_each_other_stand_at_different_heights_and_a_drawn_one_keeps_its_own() -> None:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    with closing(SimpleNamespace(close=server.stop)):
        drawing = Drawing(server, origin_m=(0.0, 0.0))
        heights = []
        added = server.scene.add_label

        def add_label(name: str, text: str, *, position: tuple[float, float, float], **shown: object) -> object:
            heights.append((text, position[2]))
            return added(name, text, position=position, **shown)  # type: ignore[arg-type]

        server.scene.add_label = add_label  # type: ignore[method-assign]
        drawing.anchor("office", (0.0, 0.0))
        drawing.anchor("desk", (0.5, 0.5))
        drawing.forbidden("stairs", [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)])
        drawing.anchor("dock", (20.0, 0.0))
        drawing.anchor("office", (0.0, 0.0))
    found = [z for _, z in heights[:3]]
    assert all(abs(a - b) >= LABEL_HEIGHT_M for i, a in enumerate(found) for b in found[:i])
    assert heights[3] == ("dock", heights[0][1]) and heights[4] == heights[0]
