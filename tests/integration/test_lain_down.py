"""Where a robot cannot be sent to its safe point, its page says that it was told to lie down, and why."""

from html import unescape

from tests.builders.consoles import console_stand


def test_the_robots_page_says_why_it_lies_down_instead_of_going_to_safety() -> None:
    with console_stand() as stand:
        operator = stand.operator()
        sent = operator.post("/robots/vbot-1/safe", data={"reason": "end of the shift", "meant": "go"})
        assert sent.status_code == 303, sent.text
        page = " ".join(unescape(operator.get("/robots/vbot-1").text).split())
        assert "operator sent it to safety (end of the shift)." in page
        assert "told to lie down where it stood. No pose says where the robot stands." in page
        stand.driving()
        assert "told to lie down" not in operator.get("/robots/vbot-1").text
