"""Tables on a terminal and in files: columns, wrapped text, names from files, colours."""

from __future__ import annotations

import io
import os
from unittest.mock import patch

import pytest

from lacmesh.cli.tables import Table


class Terminal(io.StringIO):
    """A stream that is a terminal."""

    encoding = "utf-8"

    def isatty(self):
        return True


def printed(table, columns=None):
    """Lines of a table, on a terminal of so many columns, or in a file."""
    out = io.StringIO() if columns is None else Terminal()
    size = os.terminal_size((columns or 0, 0))
    with (
        patch("sys.stdout", out),
        patch("shutil.get_terminal_size", lambda: size),
        patch.dict(os.environ, {"TERM": "xterm", "NO_COLOR": ""}),
    ):
        table.print()
    return out.getvalue().splitlines()


def test_numbers_are_aligned_to_the_right_and_sections_apart():
    table = Table("part", "cells", "+share")
    table.add_row("lower", "1,000", "0.5")
    table.add_section()
    table.add_row("all", "20", "10.25")
    assert printed(table) == [
        "",
        " part    cells   share",
        " " + "─" * 21,
        " lower   1,000     0.5",
        "",
        " all        20   10.25",
        "",
    ]


@pytest.mark.parametrize("columns", [30, 50, 79])
def test_text_that_does_not_fit_is_wrapped_and_none_is_lost(columns):
    words = " ".join(f"word{k}" for k in range(40))
    table = Table("rule", "what", "+number")
    table.add_row("gap", words, "1,000,000")
    lines = printed(table, columns)
    assert max(map(len, lines)) < columns
    assert " ".join(lines[3:]).replace("gap", "").replace("1,000,000", "").split() == words.split()


def test_the_first_cell_has_its_colour_on_a_terminal_alone():
    table = Table("finding", "what")
    table.add_row("error", "some of it", colour="31")
    assert printed(table, 80)[3] == " \x1b[1;31merror\x1b[0m     some of it"
    assert printed(table)[3] == " error     some of it"


def test_names_from_files_hold_no_ends_of_lines_and_no_commands():
    table = Table("group", "")
    table.add_row("a\nb\x1b[2J", "")
    assert printed(table)[3] == " a\\nb\\x1b[2J"


def test_letters_that_are_two_columns_wide_count_as_two():
    table = Table("group", "type")
    table.add_row("接触面", "QUAD4")
    table.add_row("slave", "QUAD4")
    assert printed(table)[3:5] == [" 接触面   QUAD4", " slave    QUAD4"]
