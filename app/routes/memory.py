"""/memory: what is remembered beyond one mission, by role."""

from typing import Annotated, get_args

from fastapi import APIRouter, Query
from starlette.responses import HTMLResponse

from app.console import ActorDep, ConsoleDep
from app.views.memory import kinds_of, memory_page
from app.web.rendering import render
from harness.contracts.errors import UnknownName
from harness.contracts.memory import ADMISSIBLE, MemoryQuery, RecordStanding
from harness.contracts.reasons import because

router = APIRouter(prefix="/memory")
SHOWN = 200


@router.get("")
def index(
    console: ConsoleDep,
    actor: ActorDep,
    role: str = "spatial",
    subject: Annotated[str, Query(max_length=200)] = "",
    everything: bool = False,
) -> HTMLResponse:
    """Records of one role; with `everything` those that roles are no longer shown, too."""
    kinds = kinds_of(role)
    if not kinds:
        raise UnknownName(because("unknown_memory_role", role=role[:40]))
    standings = get_args(RecordStanding) if everything else ADMISSIBLE
    query = MemoryQuery(kinds=kinds, subject=subject.strip(), standings=standings, limit=SHOWN)
    found = console.runtime.memory.find(query)
    shell = console.shell("Memory", "memory", actor)
    page = memory_page(shell, role, found, subject=subject, everything=everything, limit=SHOWN)
    return render("memory/index.html", page)
