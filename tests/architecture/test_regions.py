"""Checks that the mission page's regions are one table: a new one needs one line, a template and what the
template reads.
"""

import re

from app.routes.mission_at import MissionAt
from app.web.regions import REGIONS
from app.web.response_cache import FOR_EVERYBODY
from tests.architecture.markup import template_texts
from tests.architecture.sources import ROOT, modules

TABLE = "app/web/regions.py"
MANY = 4


def listed(text: str) -> set[str]:
    """Names of regions that occur as text elsewhere: quoted, or between the bars of a pattern."""
    return {name for name in REGIONS if re.search(rf"""["'|(]{name}["'|)]""", text)}


def test_every_region_has_what_its_name_stands_for() -> None:
    texts = template_texts()
    for name, region in REGIONS.items():
        assert f'live(page, "{name}")' in texts[region.template]
        assert getattr(MissionAt, name).func.__name__ == name
        assert f'{{% include "{region.template}" %}}' in texts["missions/detail.html"]
        assert FOR_EVERYBODY.fullmatch(f"/missions/m-1/{name}")


def test_every_template_that_is_fetched_by_itself_stands_in_the_table() -> None:
    live = {name for text in template_texts().values() for name in re.findall(r'live\(page, "(\w+)"\)', text)}
    assert live == set(REGIONS)


def test_the_regions_are_listed_in_one_place() -> None:
    texts = {source.path: source.text for source in modules("app") if source.path != TABLE}
    texts |= {str(path): path.read_text(encoding="utf-8") for path in (ROOT / "static" / "js").glob("*.js")}
    again = {path: found for path, text in texts.items() if len(found := listed(text)) >= MANY}
    assert again == {}


def test_a_second_list_is_found() -> None:
    assert len(listed('PARTS = ["head", "robot", "graph", "stages"]')) == MANY
    assert len(listed("/missions/[^/]+/(head|robot|graph|stages)")) == MANY
