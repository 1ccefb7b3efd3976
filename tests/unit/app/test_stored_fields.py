"""What a stored value says in words: leaf by leaf, with units, without empty fields."""

from app.views.measures import fields


def told(**stored: object) -> list[tuple[str, str]]:
    return [(one.name, one.value) for one in fields(stored)]


def test_numbers_carry_the_unit_of_their_name_and_three_decimals() -> None:
    assert told(within_m=0.044691179, point_m=(11.0, 8.557)) == [("within", "0.045 m"), ("point", "(11, 8.56) m")]


def test_nested_values_are_told_by_their_leaves_and_their_kind_by_nobody() -> None:
    assert told(kind="place", place={"kind": "x", "name": "Dock"}) == [("name", "Dock")]
    assert told(parameters=[{"name": "text", "required": True}]) == [("parameters", "name text, required yes")]
    assert told(floor_m=[[0, 1], [2.5, 3]]) == [("floor", "(0, 1), (2.50, 3) m")]


def test_what_is_not_known_is_not_told_but_a_zero_and_a_no_are() -> None:
    assert told(yaw_rad=None, place="", aliases=[], count=0, held=False) == [("count", "0"), ("held", "no")]


def test_digests_are_cut_to_what_people_compare() -> None:
    assert told(blob="ab" * 32, frames=["cd" * 32, "ef" * 32]) == [
        ("blob", "abababab"),
        ("frames", "cdcdcdcd, efefefef"),
    ]
