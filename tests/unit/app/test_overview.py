"""The map of the first page: names of robots that stand together are written one above the other."""

from app.views.overview import OverviewMark, apart


def mark(robot_id: str, x: float, y: float) -> OverviewMark:
    return OverviewMark(robot_id=robot_id, x=x, y=y, yaw_deg=0.0, trail="", handoff_id="")


def test_names_of_robots_at_one_place_stand_in_rows_and_those_elsewhere_do_not_move() -> None:
    found = apart([mark("a", 0.0, 0.0), mark("b", 0.4, 0.1), mark("c", 0.2, -0.3), mark("d", 8.0, 0.0)])
    assert [one.row for one in found] == [0, 1, 2, 0]


def test_a_row_that_became_free_is_taken_again() -> None:
    found = apart([mark("a", 0.0, 0.0), mark("b", 2.0, 0.0), mark("c", 4.0, 0.0)])
    assert [one.row for one in found] == [0, 1, 0]
