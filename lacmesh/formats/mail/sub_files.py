"""Split of a .mail file into sub-files: a keyword, a header, a body, up to FINSF (or FIN, which ends the file).

The grammar is code_aster's: FIN and FINSF count at the start of a line only; the header is the rest of the keyword's
line, or as many lines as its NBLIGE says; of its other words only NOM means anything (NOM=INDEFINI does not); % begins
a comment.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import NamedTuple

from lacmesh.formats.source import SourceFile
from lacmesh.formats.text import decoded

_COMMENT = re.compile(rb"%[^\n]*")
_SEPARATORS = bytes.maketrans(b"=,\t", b"   ")


class SubFile(NamedTuple):
    """A sub-file: its `keyword` at byte `at`, the `name` in its header, its body from byte `begin` to `end`."""

    keyword: str
    at: int
    name: bytes | None
    begin: int
    end: int


def sub_files(source: SourceFile, check: Callable[[str, int], None]) -> Iterator[SubFile]:
    """The sub-files of a file, up to FIN. Raises ReadError where FINSF or FIN is missing.

    `check(keyword, at)` raises the error for a keyword that is none.
    """
    while True:
        at = _next_word(source)
        line = _line(source, at)
        words = _COMMENT.sub(b"", line).translate(_SEPARATORS).split()
        source.section_start = at
        if words[0] == b"FIN":
            return
        if words[0] == b"FINSF":
            source.position = at + len(line)
            continue
        check(decoded(words[0]), at)
        name, lines = _header(source, words[1:])
        begin = at + len(line)
        for _ in range(lines - 1):
            if begin >= source.size:
                break
            begin += len(_line(source, begin))
        end, last = _end(source, begin, words[0])
        yield SubFile(decoded(words[0]), at, name, begin, end)
        if last:
            return
        source.position = end + len(b"FINSF")


def body(source: SourceFile, part: SubFile) -> bytes:
    """The text of a sub-file, blanks in place of comments."""
    text = bytes(source.data[part.begin : part.end])
    if b"%" in text:
        text = _COMMENT.sub(lambda comment: b" " * len(comment[0]), text)
    return text


def _line(source: SourceFile, at: int) -> bytes:
    """The line that holds byte `at`, from there on, with its end."""
    end = source.data.find(b"\n", at)
    return bytes(source.data[at : source.size if end < 0 else end + 1])


def _next_word(source: SourceFile) -> int:
    """Byte offset of the next word outside comments. Raises ReadError at the end of the file."""
    at = source.position
    while at < source.size:
        line = _line(source, at)
        text = _COMMENT.sub(b"", line).translate(_SEPARATORS)
        if text.strip():
            return at + len(text) - len(text.lstrip())
        at += len(line)
    raise source.error("the file ends without FIN: it may be cut off", source.size)


def _header(source: SourceFile, words: list[bytes]) -> tuple[bytes | None, int]:
    """The name in a header, and how many lines the header has."""
    name, lines = None, 1
    for word, value in pairwise([*words, b""]):
        if word == b"NOM":
            name = value if value not in (b"", b"INDEFINI") else None
        elif word == b"NBLIGE":
            if not re.fullmatch(rb"[0-9]{1,6}", value):
                raise source.error("NBLIGE should be the number of lines of the header")
            lines = max(1, int(value))
    return name, lines


def _end(source: SourceFile, begin: int, keyword: bytes) -> tuple[int, bool]:
    """Byte offset of the FINSF or FIN that ends a sub-file, and True if it is FIN. Raises ReadError without either."""
    at = begin
    while True:
        at = source.data.find(b"FIN", at)
        if at < 0:
            raise source.error(f"{decoded(keyword)} has no FINSF after it: the file may be cut off")
        line_begin = source.data.rfind(b"\n", begin, at) + 1 or begin
        word = re.match(rb"FIN(SF)?(?![A-Za-z0-9_])", source.data[at : at + 6])
        if word and not source.data[line_begin:at].strip():
            return at, word[1] is None
        at += 3
