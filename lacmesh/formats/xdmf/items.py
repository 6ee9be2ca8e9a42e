"""The DataItems of an XDMF file: arrays in the XML, in HDF5 files beside it, or in files of plain bytes."""

from __future__ import annotations

import re
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import ReadError
from lacmesh.formats.med.hdf5 import Branch, opened
from lacmesh.formats.vtu.codec import DAMAGE, from_text

ItemElement = ElementTree.Element

_KINDS = {"Float": "f", "Int": "i", "UInt": "u"}
_BYTES = {"Float": "48", "Int": "1248", "UInt": "1248"}
_ORDERS = {"Native": "=", "Little": "<", "Big": ">", "LittleEndian": "<", "BigEndian": ">"}
_XPOINTER = re.compile(r"\s*(?:xpointer\()?(/[^()]*?)(?:/\*\[([^\]]*)\])?\)?\s*")


@dataclass(frozen=True)
class XdmfSource:
    """An XDMF file that is being read, with the HDF5 files that it names."""

    path: Path
    root: ItemElement
    stack: ExitStack
    heavy: dict[str, Branch] = field(default_factory=dict)

    def error(self, message: str, place: str | None = None) -> ReadError:
        """A ReadError about the file, at an element."""
        return ReadError(self.path, message, place)

    def file(self, name: str) -> Branch:
        """The root of an HDF5 file, named as in the XML."""
        if name not in self.heavy:
            path = self.path.parent / name
            if not path.is_file():
                raise self.error(f"names the HDF5 file {name}, which is not beside it")
            self.heavy[name] = self.stack.enter_context(opened(path))
        return self.heavy[name]

    def children(self, element: ItemElement) -> list[ItemElement]:
        """Children of an element, including those that it refers to elsewhere in the file. Raises ReadError."""
        items: list[ItemElement] = []
        for child in element:
            if child.tag.endswith("}include") or child.tag == "xi:include":
                items += self._included(child.get("xpointer", ""))
            elif child.get("Reference") == "XML":
                items += self._included("".join(child.itertext()))
            else:
                items.append(child)
        return items

    def _included(self, pointer: str) -> list[ItemElement]:
        pointed = _XPOINTER.fullmatch(pointer.replace("element(", "xpointer("))
        path = pointed.group(1).replace("//", "/.//").strip("/") if pointed else ""
        place = None
        if path.startswith(("Xdmf/", ".//")):
            try:
                place = self.root.find(path.removeprefix("Xdmf/"))
            except (SyntaxError, KeyError):
                place = None
        if place is None or pointed is None:
            raise self.error(f"refers to {pointer[:80]!r}, which is not found")
        if not pointed.group(2):
            return [place]
        return [child for child in place if child.tag in re.findall(r"\w+", pointed.group(2))]

    def item(self, parent: ItemElement) -> tuple[ItemElement, str]:
        """The DataItem of an element, and its text, which is equal for the same array. Raises ReadError."""
        for child in self.children(parent):
            if child.tag == "DataItem":
                return child, " ".join("".join(child.itertext()).split())
        raise self.error("has no DataItem", _place(parent))

    def array(self, parent: ItemElement) -> NDArray:
        """The values of an element's DataItem, in the shape that its Dimensions say."""
        item, text = self.item(parent)
        if item.get("ItemType", "Uniform") != "Uniform":
            raise self.error(f"the item type {item.get('ItemType')!r} is not read", _place(parent))
        shape = self._dimensions(item, parent)
        form = item.get("Format", "XML")
        try:
            if form == "HDF":
                values = self._from_hdf5(text, parent)
            elif form == "XML":
                values = from_text(text, self._kind(item, parent))
            elif form == "Binary":
                values = self._from_bytes(item, text, shape, parent)
            else:
                raise ValueError(f"the format {form!r} is not known")
            if shape is None:
                return values
            if int(np.prod(shape, dtype=object)) != values.size:
                raise ValueError(f"{values.size} values for dimensions {' '.join(map(str, shape))}")
            return values.reshape(shape)
        except DAMAGE as error:
            raise self.error(f"cannot be read ({error})", _place(parent)) from None

    def _dimensions(self, item: ItemElement, parent: ItemElement) -> tuple[int, ...] | None:
        text = item.get("Dimensions")
        if text is None:
            return None
        if not re.fullmatch(r"\s*\d{1,18}(\s+\d{1,18})*\s*", text):
            raise self.error(f"dimensions {text[:40]!r} are no numbers", _place(parent))
        return tuple(int(n) for n in text.split())

    def _kind(self, item: ItemElement, parent: ItemElement) -> np.dtype:
        name = item.get("NumberType", item.get("DataType", "Float"))
        size = item.get("Precision", "4")
        if name in ("Char", "UChar"):
            name, size = {"Char": "Int", "UChar": "UInt"}[name], "1"
        if name not in _KINDS or size not in _BYTES[name]:
            raise self.error(f"numbers of type {name} and {size} bytes are not known", _place(parent))
        return np.dtype(f"{_KINDS[name]}{size}")

    def _from_hdf5(self, text: str, parent: ItemElement) -> NDArray:
        name, separator, inside = text.rpartition(":")
        if not separator or not inside.strip("/"):
            raise self.error(f"{text[:60]!r} does not name an array as file:/place", _place(parent))
        branch = self.file(name)
        *groups, last = inside.strip("/").split("/")
        for group in groups:
            branch = branch.branch(group)
        return branch.numbers(last)

    def _from_bytes(self, item: ItemElement, name: str, shape: tuple[int, ...] | None, parent: ItemElement) -> NDArray:
        order = _ORDERS.get(item.get("Endian", "Native"))
        if order is None or item.get("Compression", "Raw") != "Raw" or shape is None:
            raise ValueError("such an item of bytes is not read")
        kind = self._kind(item, parent)
        count, seek = int(np.prod(shape, dtype=object)), int(item.get("Seek", "0"))
        path = self.path.parent / name
        try:
            if count * kind.itemsize + seek > path.stat().st_size:
                raise ValueError(f"{name} is too short")
            return np.fromfile(path, kind.newbyteorder(order), count, offset=seek).astype(kind)  # type: ignore[arg-type]
        except OSError as error:
            raise ValueError(f"{name}: {error.strerror or error}") from None


def _place(element: ItemElement) -> str:
    name = element.get("Name")
    return f"<{element.tag}>" if name is None else f"<{element.tag} Name={name!r}>"
