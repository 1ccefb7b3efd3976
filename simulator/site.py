"""The built-in site: an office, a corridor and a storage area, with boxes and things in the boxes' colours."""

import math

from harness.contracts.values import Point
from simulator import solids

CARDBOARD: solids.Rgb = (0.72, 0.53, 0.33)
BLUE: solids.Rgb = (0.20, 0.38, 0.62)
STEEL: solids.Rgb = (0.48, 0.51, 0.55)
WOOD: solids.Rgb = (0.64, 0.50, 0.36)
YELLOW: solids.Rgb = (0.86, 0.72, 0.22)
DARK: solids.Rgb = (0.22, 0.24, 0.27)

START = (-0.23, 0.0, 0.0)
PASSAGE_M: tuple[Point, ...] = ((10.3, 10.2), (11.7, 10.2), (11.7, 12.2), (10.3, 12.2))

WALLS: tuple[solids.Solid, ...] = (
    solids.wall("office-west", (-2.05, -3.7), (-2.05, 5.95)),
    solids.wall("office-south", (-2.05, -3.65), (7.65, -3.65)),
    solids.wall("office-east", (7.65, -3.7), (7.65, 3.7)),
    solids.wall("office-north-west", (-2.05, 3.65), (0.35, 3.65)),
    solids.wall("office-north-east", (1.65, 3.65), (14.55, 3.65)),
    solids.wall("corridor-east", (14.55, 3.6), (14.55, 6.0)),
    solids.wall("corridor-north-west", (-2.05, 5.95), (10.35, 5.95)),
    solids.wall("corridor-north-east", (11.65, 5.95), (14.55, 5.95)),
    solids.wall("storage-west", (7.45, 5.9), (7.45, 13.45)),
    solids.wall("storage-east", (14.55, 5.9), (14.55, 13.45)),
    solids.wall("storage-north", (7.45, 13.45), (14.55, 13.45)),
)

SHELVES: tuple[solids.Solid, ...] = (
    solids.standing("shelf-left", "shelf", (9.95, 11.2), (0.5, 2.2, 1.8), STEEL),
    solids.standing("shelf-right", "shelf", (12.05, 11.2), (0.5, 2.2, 1.8), STEEL),
    solids.standing("shelf-west", "shelf", (7.8, 9.5), (0.5, 2.6, 1.9), STEEL),
    solids.standing("shelf-east", "shelf", (14.2, 9.0), (0.5, 2.6, 1.9), WOOD),
)

FURNITURE: tuple[solids.Solid, ...] = (
    solids.standing("desk-west", "desk", (2.4, 0.0), (0.8, 1.6, 0.74), WOOD),
    solids.standing("desk-east", "desk", (3.9, 0.0), (0.8, 1.6, 0.74), WOOD),
    solids.standing("chair-west", "chair", (3.15, 0.35), (0.42, 0.42, 0.9), DARK),
    solids.standing("chair-east", "chair", (3.15, -0.45), (0.42, 0.42, 0.9), BLUE),
    solids.standing("cabinet", "shelf", (7.3, 2.6), (0.5, 1.2, 1.5), STEEL),
)

BOXES: tuple[solids.Solid, ...] = (
    solids.standing("box-passage-1", "box", (10.68, 11.1), (0.55, 0.5, 0.5), CARDBOARD),
    solids.standing("box-passage-2", "box", (10.66, 11.62), (0.45, 0.4, 0.42), CARDBOARD),
    solids.standing("box-stack-1", "box", (13.2, 7.2), (0.6, 0.6, 0.6), CARDBOARD),
    solids.standing("box-stack-2", "box", (8.6, 12.6), (0.6, 0.5, 0.55), BLUE),
)

DECOR: tuple[solids.Solid, ...] = (
    solids.Solid(
        name="poster-north", kind="poster", centre_m=(11.9, 13.38, 1.2), half_m=(0.4, 0.01, 0.3), rgb=CARDBOARD
    ),
    solids.Solid(name="poster-east", kind="poster", centre_m=(14.48, 11.5, 1.3), half_m=(0.01, 0.35, 0.45), rgb=BLUE),
    solids.Solid(name="poster-office", kind="poster", centre_m=(4.0, 3.58, 1.4), half_m=(0.6, 0.01, 0.4), rgb=YELLOW),
    solids.Solid(
        name="mark-aisle", kind="mark", centre_m=(11.35, 10.6, 0.001), half_m=(0.18, 0.3, 0.001), rgb=CARDBOARD
    ),
    solids.Solid(
        name="mark-line-left", kind="mark", centre_m=(10.3, 11.2, 0.001), half_m=(0.03, 1.0, 0.001), rgb=YELLOW
    ),
    solids.Solid(
        name="mark-line-right", kind="mark", centre_m=(11.7, 11.2, 0.001), half_m=(0.03, 1.0, 0.001), rgb=YELLOW
    ),
    solids.sign("B-12", (10.9, 13.38, 1.2), facing_rad=-math.pi / 2, size_m=(0.6, 0.3)),
    solids.Solid(name="mark-corridor", kind="mark", centre_m=(6.0, 4.1, 0.001), half_m=(0.5, 0.05, 0.001), rgb=BLUE),
)

TROLLEY: solids.Solid = solids.standing("trolley", "box", (11.0, 9.05), (0.4, 0.25, 1.3), STEEL)
"""Stands between the approach of the storage area and its passage: from there the passage cannot be seen."""


def storage_site() -> solids.SiteModel:
    """The site of `harness/baseline/site/site.yaml`, as solids."""
    return solids.SiteModel(
        name="storage-site",
        frame="map",
        map_version="site-1",
        solids=WALLS + SHELVES + FURNITURE + BOXES + DECOR,
        lamps_m=((1.0, 1.0, 5.0), (5.5, -1.0, 5.0), (2.0, 5.0, 4.0), (10.0, 7.0, 6.0)),
    )
