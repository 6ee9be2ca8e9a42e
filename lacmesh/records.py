"""Dataclasses as those of the standard library, whose classes take a quarter of the time to make.

Up to Python 3.12 `dataclasses` writes and compiles five or six methods for each frozen class, 0.7 ms each. For the 150
records that a run of a small model imports that was 0.1 s, a fifth of what the run takes beyond importing numpy, scipy
and numba. Here all records share the methods that need not be written for each; only `__init__` is.

Laws of materials and of contact are the standard library's: programs derive frozen dataclasses of their own from them,
and the standard library lets these derive from its own frozen ones alone.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # so that editors and type checkers know the fields
    from dataclasses import dataclass as dataclass
else:

    def dataclass(
        cls: type | None = None,
        /,
        *,
        frozen: bool = False,
        eq: bool = True,
        repr: bool = True,
        kw_only: bool = False,
    ) -> Callable[[type], type] | type:
        """Make a dataclass of a class, with the meaning that the options have in `dataclasses.dataclass`."""

        def made(cls: type) -> type:
            """Return the class with the methods of a record, but for those that it has itself."""
            own = set(vars(cls))
            dataclasses.dataclass(cls, eq=False, repr=False, kw_only=kw_only)
            methods = {"__repr__": _repr} if repr else {}
            methods |= {"__eq__": _eq, "__hash__": _hash if frozen else None} if eq else {}
            methods |= {"__setattr__": _set_once, "__delattr__": _refuse} if frozen else {}
            for name in methods.keys() - own:
                setattr(cls, name, methods[name])
            return cls

        return made if cls is None else made(cls)


def _compared(record: Any) -> tuple[Any, ...]:
    return tuple(getattr(record, one.name) for one in dataclasses.fields(record) if one.compare)


@recursive_repr()
def _repr(self: Any) -> str:
    shown = (f"{one.name}={getattr(self, one.name)!r}" for one in dataclasses.fields(self) if one.repr)
    return f"{type(self).__qualname__}({', '.join(shown)})"


def _eq(self: Any, other: object) -> bool:
    return _compared(self) == _compared(other) if type(other) is type(self) else NotImplemented


def _hash(self: Any) -> int:
    return hash(_compared(self))


def _set_once(self: Any, name: str, value: Any) -> None:
    """Set a field that has no value yet, as `__init__` does; refuse everything else."""
    values = self.__dict__
    if name in values or name not in self.__dataclass_fields__:
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
    values[name] = value


def _refuse(self: Any, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
