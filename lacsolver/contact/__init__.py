"""Contact of two skins: zones, and their contact matrices (B, G, w) in a given configuration.

zone = slave and master skins, the macro-element of each slave face   (zone)
rows = int q . (v(x) - v(x_bar)) of each macro-element                (rows)
interface = pairs, points, B, G, w, coverage                          (interface)
"""

from lacsolver.contact.interface import Interface, Pairing, integrate
from lacsolver.contact.zone import Zone

__all__ = ["Interface", "Pairing", "Zone", "integrate"]
