"""Names of units: words beside the numbers of pictures and reports. Nothing is computed with them."""

from __future__ import annotations

from typing import NamedTuple


class Units(NamedTuple):
    """Names of the units of force, length, stress and time, as a case gives them; "" for those that are not given."""

    force: str = ""
    length: str = ""
    stress: str = ""
    time: str = ""

    @classmethod
    def of(cls, text: str | None) -> Units:
        """Return the names in a text such as "N, mm, MPa" or "N, mm, MPa, s"; missing ones are "".

        >>> Units.of("N, mm, MPa").stress, Units.of(None).stress
        ('MPa', '')
        """
        return cls(*(word.strip() for word in (text or "").split(",")[: len(cls._fields)]))

    @property
    def energy(self) -> str:
        """Unit of energies."""
        return f"{self.force} {self.length}" if self.force and self.length else ""

    @property
    def moment(self) -> str:
        """Unit of moments."""
        return self.energy

    def label(self, words: str, of: str) -> str:
        """Return words with the unit of a kind of quantity, such as `stress`, in brackets.

        >>> Units.of("N, mm, MPa").label("gap", "length"), Units().label("gap", "length")
        ('gap (mm)', 'gap')
        """
        unit = getattr(self, of) if of else ""
        return f"{words} ({unit})" if unit else words


#: for a case that names no units
NO_UNITS = Units()
