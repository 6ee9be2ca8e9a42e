"""All bad inputs."""

from __future__ import annotations

from functools import cache

from tests.bad_input import (
    cad_cases,
    command_cases,
    file_cases,
    med_cases,
    mesh_cases,
    msh_cases,
    text_cases,
    tool_cases,
    xml_cases,
)
from tests.bad_input.case import Case


@cache
def all_cases() -> tuple[Case, ...]:
    """Every case but those of `stop_cases`."""
    sources = (
        file_cases,
        mesh_cases,
        msh_cases,
        med_cases,
        text_cases,
        xml_cases,
        command_cases,
        tool_cases,
        cad_cases,
    )
    return tuple(case for source in sources for case in source.cases())
