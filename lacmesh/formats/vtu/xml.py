"""XML of a VTU file: its elements, and their arrays in any encoding.

If the arrays stand in one block of raw bytes at the end, the file is not XML from there on: the head is parsed alone.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import ReadError, reading
from lacmesh.formats.vtu.codec import DAMAGE, Coding, Order, from_text, numbers

XmlElement = ElementTree.Element

_KINDS = {f"{'U' * u}Int{8 * n}": np.dtype(f"{'u' if u else 'i'}{n}") for u in (0, 1) for n in (1, 2, 4, 8)}
_KINDS |= {"Float32": np.dtype(np.float32), "Float64": np.dtype(np.float64), "String": np.dtype(np.uint8)}
_APPENDED = re.compile(rb"<AppendedData\b[^>]*>\s*_")
_ENCODING = re.compile(rb"encoding\s*=\s*[\"'](\w+)[\"']")


def parsed(path: Path, text: bytes) -> XmlElement:
    """The root of an XML text. Raises ReadError: for damage, and for entities, which no mesh needs."""
    if b"<!ENTITY" in text:
        raise ReadError(path, "declares XML entities, which are not read")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError, RecursionError) as error:
        raise ReadError(path, f"is no sound XML ({error})") from None


@dataclass(frozen=True)
class Document:
    """A VTU file: its root, how its arrays are coded, and the block of arrays behind it (`base64`: as text)."""

    path: Path
    root: XmlElement
    coding: Coding
    appended: memoryview
    base64: bool

    def error(self, message: str, place: str | None = None) -> ReadError:
        """A ReadError about the file, at an element."""
        return ReadError(self.path, message, place)

    def count(self, element: XmlElement, name: str, default: int | None = None) -> int:
        """Integer value of an attribute that counts something. Raises ReadError."""
        text = element.get(name)
        if text is None and default is not None:
            return default
        if text is None or not re.fullmatch(r"\s*\d{1,18}\s*", text):
            raise self.error(f"{name} should be a number, not {str(text)[:40]!r}", f"<{element.tag}>")
        return int(text)

    def array(self, element: XmlElement, most: int | None = None) -> NDArray:
        """Values of a DataArray, flat; `most`: the largest possible number of values in a compressed one, if known."""
        dtype = _KINDS.get(element.get("type", ""))
        if dtype is None:
            raise self.error(f"the type {element.get('type')!r} is not known", _place(element))
        try:
            if element.get("format", "ascii") == "ascii":
                return from_text(element.text or "", dtype)
            n_bytes = None if most is None else most * dtype.itemsize
            return numbers(self._bytes(element, n_bytes), dtype, self.coding.order)
        except DAMAGE as error:
            raise self.error(f"cannot be read ({error})", _place(element)) from None

    def text(self, element: XmlElement) -> str:
        """The text of an array of bytes, or of strings, of which each ends in a NUL; "" where there is none."""
        values = self.array(element)
        return values.tobytes().replace(b"\0", b"").decode("utf-8", "replace") if values.dtype.itemsize == 1 else ""

    def _bytes(self, element: XmlElement, most: int | None) -> bytes:
        form = element.get("format")
        if form == "appended":
            offset = self.count(element, "offset")
            if offset >= len(self.appended):
                raise ValueError(f"offset {offset} is past the end")
            return self.coding.array(self.appended[offset:], self.base64, most)
        if form == "binary":
            return self.coding.array("".join((element.text or "").split()).encode("ascii"), True, most)
        raise ValueError(f"the format {form!r} is not known")


def _place(element: XmlElement) -> str:
    return f"<{element.tag} Name={element.get('Name')!r}>"


def opened(path: Path) -> Document:
    """Open a VTU file. Raises ReadError."""
    with reading(path):
        data = path.read_bytes()
    head, appended, base64 = data, memoryview(b""), False
    appended_section = _APPENDED.search(data)
    if appended_section:
        start = data.index(b"<AppendedData", appended_section.start())
        encoding = _ENCODING.search(appended_section.group())
        base64 = bool(encoding) and encoding.group(1).lower() == b"base64" if encoding else False
        head = data[:start] + b"</VTKFile>"
        appended = memoryview(data)[appended_section.end() :]
        if base64:
            appended = memoryview(b"".join(data[appended_section.end() :].split(b"<", 1)[0].split()))
    root = parsed(path, head)
    if root.tag != "VTKFile" or root.get("type") != "UnstructuredGrid":
        raise ReadError(
            path, f"holds {root.get('type') or root.tag}; of VTK's files only UnstructuredGrid (.vtu) is read"
        )
    return Document(path, root, _coding(path, root.attrib), appended, base64)


def _coding(path: Path, attributes: Mapping[str, str]) -> Coding:
    orders: dict[str, Order] = {"LittleEndian": "<", "BigEndian": ">"}
    order = orders.get(attributes.get("byte_order", "LittleEndian"))
    header = {"UInt32": "u4", "UInt64": "u8"}.get(attributes.get("header_type", "UInt32"))
    if order is None or header is None:
        raise ReadError(path, "has a byte_order or header_type that VTK does not know")
    return Coding(order, np.dtype(order + header), attributes.get("compressor", ""))
