"""The record of bolts that are tightened: sections at which a body is shortened by a force or by a length."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from lacsolver.case.entry import Entry
from lacsolver.case.keys import Load, Numbers, Section, key
from lacsolver.case.kinds import GROUP, NOT_NEGATIVE, POINT, text
from lacsolver.case.value_kinds import VALUE_OF_TIME

#: a group that the mesh has itself, or whose two sides it has (`problem.sections`)
_SECTION_GROUP = replace(GROUP, is_group=False)


@dataclass(frozen=True, kw_only=True, repr=False)
class Pretension(Entry):
    """[[pretension]]: a section of a bolt, at which it is shortened.

    >>> Pretension(group="shank", force=40e3, lock=1.0).name
    'shank'
    """

    SECTION: ClassVar = Section(
        "pretension", True, "a section of a bolt, at which it is shortened by a force or by a length",
        one_of=(("force", "shortening"),), named_after="group",
    )  # fmt: skip
    name: str = key(text("a name"), "", "name in the results", None, "the group's name")
    group: str = key(
        _SECTION_GROUP, "", "faces inside the bolt, across all of it, where it is divided; or NAME of two skins NAME_a "
        "and NAME_b, as lacmesh split makes them",
    )  # fmt: skip
    normal: Numbers = key(
        POINT, "", "direction of the shortening, of any length and either sign", None, "the mean normal of the faces"
    )
    force: Load = key(
        VALUE_OF_TIME, "force", "force that pulls the two sides together: the bolt's tension", None, load=True
    )
    shortening: Load = key(
        VALUE_OF_TIME, "length", "length by which the bolt is shortened at the section", None, load=True
    )
    lock: float | None = key(
        NOT_NEGATIVE, "time", "time from which the shortening stays as it is, whatever the force becomes", None, "never"
    )
