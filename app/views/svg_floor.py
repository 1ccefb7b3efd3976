"""SVG coordinates of a floor plan: metres, with the y axis flipped so that north is up."""

from collections.abc import Sequence

from harness.contracts.values import Point


def polyline(points: Sequence[Point]) -> str:
    """Points of the map frame as the text of an SVG `points`."""
    return " ".join(f"{x:.3f},{-y:.3f}" for x, y in points)


def view_box(xs: Sequence[float], ys: Sequence[float], *, margin_m: float) -> tuple[str, float, float]:
    """What holds these coordinates of the map frame with a margin around: (SVG viewBox, width, height in metres)."""
    width, height = max(xs) - min(xs) + 2 * margin_m, max(ys) - min(ys) + 2 * margin_m
    return f"{min(xs) - margin_m:.2f} {-max(ys) - margin_m:.2f} {width:.2f} {height:.2f}", width, height
