"""Draws random storage scenes for image analysis: a passage with or without boxes, and objects that look like boxes."""

import math

import numpy as np

from harness.contracts.ids import PlaceId
from harness.contracts.places import Passage
from harness.contracts.values import Point, Value
from simulator.site import BLUE, CARDBOARD, DARK, PASSAGE_M, STEEL, WALLS, WOOD, YELLOW
from simulator.solids import Rgb, SiteModel, Solid, standing

BOX_COLOURS: tuple[Rgb, ...] = (CARDBOARD, (0.80, 0.64, 0.45), (0.58, 0.42, 0.27), BLUE, (0.66, 0.22, 0.18), WOOD)
AISLE_X, AISLE_Y = (10.3, 11.7), (10.2, 12.2)
CLEAR_M = 0.3
Span = tuple[float, float]


class Scene(Value):
    """One scene and its ground truth. `pose` is the body's (x_m, y_m, yaw_rad) at the panorama's first heading."""

    model: SiteModel
    pose: tuple[float, float, float]
    passage: Passage
    truth_blocked: bool
    obstructions: tuple[Solid, ...]


def random_scene(seed: int) -> Scene:
    """Scene number `seed`: about half are blocked; distractors share the boxes' colours either way."""
    chance = np.random.Generator(np.random.Philox(key=[seed, 20]))
    colours = [BOX_COLOURS[index] for index in chance.permutation(len(BOX_COLOURS))[:3]]
    blocked = bool(chance.random() < 0.5)
    boxes = _boxes_inside(chance, colours) if blocked else ()
    grey = float(chance.uniform(0.5, 0.72))
    model = SiteModel(
        name=f"scene-{seed}",
        frame="map",
        map_version="site-1",
        solids=WALLS + _shelves(chance) + _flat(chance, colours) + _beside(chance, colours) + boxes,
        floor_rgb=(grey, grey * float(chance.uniform(0.94, 1.04)), grey * float(chance.uniform(0.9, 1.06))),
        lamps_m=(_lamp(chance),),
        brightness=float(chance.uniform(0.85, 1.15)),
    )
    pose = (
        11.0 + float(chance.uniform(-0.3, 0.3)),
        8.557 + float(chance.uniform(-0.3, 0.25)),
        float(chance.uniform(-math.pi, math.pi)),
    )
    passage = Passage(passage_id=PlaceId("storage_passage"), frame="map", floor_m=PASSAGE_M)
    return Scene(model=model, pose=pose, passage=passage, truth_blocked=blocked, obstructions=boxes)


def _lamp(chance: np.random.Generator) -> tuple[float, float, float]:
    return (float(chance.uniform(8.5, 13.5)), float(chance.uniform(6.5, 12.5)), float(chance.uniform(4.0, 8.0)))


def _boxes_inside(chance: np.random.Generator, colours: list[Rgb]) -> tuple[Solid, ...]:
    """One to three boxes whose centres are well inside the passage and which do not overlap."""
    found: list[Solid] = []
    count = int(chance.integers(1, 4))
    for attempt in range(30):
        if len(found) == count:
            break
        size = (float(chance.uniform(0.3, 0.65)), float(chance.uniform(0.3, 0.65)), float(chance.uniform(0.25, 0.8)))
        at = _somewhere(chance, (AISLE_X[0] + 0.25, AISLE_X[1] - 0.25), (AISLE_Y[0] + 0.25, AISLE_Y[1] - 0.35))
        if all(math.dist(at, other.centre_m[:2]) > 0.75 for other in found):
            box = standing(f"box-{attempt}", "box", at, size, colours[int(chance.integers(len(colours)))])
            found.append(_turned(box, float(chance.uniform(-0.5, 0.5))))
    return tuple(found)


def _shelves(chance: np.random.Generator) -> tuple[Solid, ...]:
    rgb = (STEEL, WOOD, CARDBOARD)[int(chance.integers(3))]
    length = float(chance.uniform(1.8, 2.3))
    return (
        standing("shelf-left", "shelf", (9.93, 11.2), (0.5, length, float(chance.uniform(1.2, 2.0))), rgb),
        standing("shelf-right", "shelf", (12.07, 11.2), (0.5, length, float(chance.uniform(1.2, 2.0))), rgb),
        standing("shelf-west", "shelf", (7.8, 9.5), (0.5, 2.6, 1.9), STEEL),
        standing("shelf-east", "shelf", (14.2, 9.0), (0.5, 2.6, 1.9), WOOD),
    )


def _flat(chance: np.random.Generator, colours: list[Rgb]) -> tuple[Solid, ...]:
    """Paint on the floor, also inside the passage, and posters, in the boxes' colours."""
    found = [
        Solid(name="line-left", kind="mark", centre_m=(10.3, 11.2, 0.001), half_m=(0.03, 1.0, 0.001), rgb=YELLOW),
        Solid(name="line-right", kind="mark", centre_m=(11.7, 11.2, 0.001), half_m=(0.03, 1.0, 0.001), rgb=YELLOW),
    ]
    for index in range(int(chance.integers(0, 4))):
        x, y = _somewhere(chance, AISLE_X, AISLE_Y)
        half = (float(chance.uniform(0.1, 0.35)), float(chance.uniform(0.1, 0.35)), 0.001)
        mark = Solid(name=f"mark-{index}", kind="mark", centre_m=(x, y, 0.001), half_m=half, rgb=_pick(chance, colours))
        found.append(_turned(mark, float(chance.uniform(-1.5, 1.5))))
    for index in range(int(chance.integers(1, 4))):
        at = (float(chance.uniform(8.5, 13.5)), 13.38, float(chance.uniform(0.5, 1.6)))
        half = (float(chance.uniform(0.2, 0.6)), 0.01, float(chance.uniform(0.2, 0.45)))
        found.append(Solid(name=f"poster-{index}", kind="poster", centre_m=at, half_m=half, rgb=_pick(chance, colours)))
    return tuple(found)


def _beside(chance: np.random.Generator, colours: list[Rgb]) -> tuple[Solid, ...]:
    """Boxes and chairs of the same colours that stand near the passage but leave it free."""
    spans: tuple[tuple[Span, Span], ...] = (
        ((8.6, 9.2), (10.2, 12.8)),
        ((12.8, 13.6), (10.0, 12.8)),
        ((12.7, 13.8), (6.8, 9.4)),
        ((8.4, 9.4), (6.8, 9.6)),
        ((10.4, 11.6), (AISLE_Y[1] + CLEAR_M + 0.35, 13.0)),
    )
    found: list[Solid] = []
    for index in chance.permutation(len(spans))[: int(chance.integers(1, 5))].tolist():
        size = (float(chance.uniform(0.3, 0.6)), float(chance.uniform(0.3, 0.6)), float(chance.uniform(0.3, 0.9)))
        kind, rgb = ("chair", DARK) if chance.random() < 0.25 else ("box", _pick(chance, colours))
        at = _somewhere(chance, *spans[index])
        thing = standing(f"beside-{index}", "chair" if kind == "chair" else "box", at, size, rgb)
        found.append(_turned(thing, float(chance.uniform(-0.4, 0.4))))
    return tuple(found)


def _somewhere(chance: np.random.Generator, span_x: Span, span_y: Span) -> Point:
    return (float(chance.uniform(*span_x)), float(chance.uniform(*span_y)))


def _pick(chance: np.random.Generator, colours: list[Rgb]) -> Rgb:
    return colours[int(chance.integers(len(colours)))]


def _turned(solid: Solid, yaw_rad: float) -> Solid:
    return Solid(
        name=solid.name,
        kind=solid.kind,
        centre_m=solid.centre_m,
        half_m=solid.half_m,
        rgb=solid.rgb,
        yaw_rad=yaw_rad,
    )
