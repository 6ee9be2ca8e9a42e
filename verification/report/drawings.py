"""The problem of each family, drawn by hand: plain SVG whose colours are the page's."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from importlib.resources import files
from itertools import pairwise

WIDTH, HEIGHT = 420, 200


def drawing(family: str) -> str:
    """The drawing of a family as an <svg> element, which `style` is for; nothing where there is none."""
    if family not in _DRAWN:
        return ""
    seen, make = _DRAWN[family]
    label = f'role="img" aria-label="{seen}"'
    return f'<svg class="drawing" viewBox="0 0 {WIDTH} {HEIGHT}" {label}>{make()}</svg>'


def _path(kind: str, d: str) -> str:
    return f'<path class="{kind}" d="{d}"/>'


def _box(kind: str, x: float, y: float, width: float, height: float) -> str:
    return _path(kind, f"M{x:g} {y:g}h{width:g}v{height:g}h{-width:g}z")


def _word(x: float, y: float, text: str, anchor: str = "middle") -> str:
    return f'<text class="note" x="{x:g}" y="{y:g}" text-anchor="{anchor}">{text}</text>'


def _dot(x: float, y: float, kind: str = "dot") -> str:
    return f'<circle class="{kind}" cx="{x:g}" cy="{y:g}" r="4"/>'


def _arrow(x: float, y: float, dx: float, dy: float, kind: str = "load") -> str:
    """From a point, along a vector."""
    size = math.hypot(dx, dy)
    u, v = dx / size * 7, dy / size * 7
    ex, ey = x + dx, y + dy
    head = f"M{ex:.1f} {ey:.1f}L{ex - u - v / 2:.1f} {ey - v + u / 2:.1f}L{ex - u + v / 2:.1f} {ey - v - u / 2:.1f}z"
    return _path(kind, f"M{x:.1f} {y:.1f}L{ex - u:.1f} {ey - v:.1f}") + _path(f"{kind} head", head)


def _grid(x: float, y: float, width: float, height: float, across: int, down: int) -> str:
    """Lines of a mesh within a box."""
    lines = [f"M{x + width * k / across:.1f} {y:g}v{height:g}" for k in range(1, across)]
    lines += [f"M{x:g} {y + height * k / down:.1f}h{width:g}" for k in range(1, down)]
    return _path("mesh", "".join(lines))


def _ground(x: float, y: float, width: float) -> str:
    """Hatched line for a support."""
    ticks = "".join(f"M{x + k:g} {y:g}l-7 8" for k in range(8, int(width) + 1, 12))
    return _path("edge", f"M{x:g} {y:g}h{width:g}") + _path("mesh", ticks)


def _curve(points: Iterable[tuple[float, float]]) -> str:
    return "L".join(f"{x:.1f} {y:.1f}" for x, y in points)


def _cut() -> str:
    triangle = "M20 150L110 150L72 40z"
    parted = "M160 150L250 150L212 40zM212 40L205 150"
    solid = "M300 130L352 165L405 118L348 35zM300 130L405 118M348 35L352 165"
    face = _path("skin fill", "M300 130L352 165L405 118z") + _path(
        "mesh", "M352 138L300 130M352 138L352 165M352 138L405 118"
    )
    return "".join(
        (
            _path("slave", triangle), _path("skin", "M20 150H110"), _arrow(122, 100, 30, 0, "load"),
            _path("slave", parted), _path("skin", "M160 150H250"), _dot(205, 150),
            _path("slave", solid), face, _path("mesh", "M348 35L352 138"), _dot(352, 138),
            _word(65, 180, "a slave cell"), _word(205, 180, "its macro-element"), _word(352, 190, "own node within"),
        )
    )  # fmt: skip


def _patch() -> str:
    loads = "".join(_arrow(120 + 30 * k, 8, 0, 22) for k in range(7))
    return "".join(
        (
            loads, _box("slave", 110, 34, 200, 64), _grid(110, 34, 200, 64, 5, 2), _box("master", 110, 98, 200, 72),
            _grid(110, 98, 200, 72, 3, 2), _path("skin", "M110 98H310"), _ground(110, 170, 200),
            _word(322, 72, "slave", "start"), _word(322, 138, "master", "start"), _word(96, 102, "p = 1", "end"),
        )
    )  # fmt: skip


def _balance() -> str:
    top, low = "M70 30H350V78Q210 112 70 78z", "M70 170H350V112Q210 146 70 112z"
    forces = "".join(_arrow(x, 94 - d, 0, -34, "one") + _arrow(x, 98 + d, 0, 34, "two") for x, d in _spots())
    return "".join(
        (_path("slave", top), _path("master", low), forces, _word(210, 22, "Σ f = 0"), _word(210, 192, "Σ x × f = 0"))
    )


def _spots() -> list[tuple[float, float]]:
    return [(130.0, 8.0), (170.0, 0.0), (210.0, -4.0), (250.0, 0.0), (290.0, 8.0)]


def _hertz() -> str:
    hollow = _curve((x, 92 - 34 * ((x - 210) / 150) ** 2) for x in range(40, 381, 10))
    ellipse = _curve((x, 92 - 44 * math.sqrt(max(0, 1 - ((x - 210) / 70) ** 2))) for x in range(140, 281, 5))
    return "".join(
        (
            _box("slave", 40, 20, 340, 72), _box("master", 40, 92, 340, 78), _path("load dashed", f"M{hollow}"),
            _path("pressure", f"M{ellipse}z"), _path("skin", "M40 92H380"), _word(210, 70, "p(r)"),
            _arrow(210, 108, 70, 0, "edge"), _word(245, 124, "a"), _word(374, 40, "clearance r²/2R", "end"),
            _word(50, 40, "exact u on the outer boundary", "start"), _word(50, 160, "half-space", "start"),
        )
    )  # fmt: skip


def _hertz_engineering() -> str:
    cap = "M89 22H331A130 130 0 0 1 89 22z"
    pushes = "".join(_arrow(120 + 45 * k, 2, 0, 16) for k in range(5))
    return "".join(
        (
            pushes, _path("slave", cap), _path("skin", "M135.4 80.5A130 130 0 0 0 284.6 80.5"),
            _box("master", 60, 104, 300, 66), _ground(60, 170, 300), _word(210, 60, "radius R"),
            _word(345, 30, "given u", "start"), _word(345, 128, "block", "end"),
        )
    )  # fmt: skip


def _press_fit() -> str:
    def ring(kind: str, inner: float, outer: float) -> str:
        x, y = 130.0, 184.0
        d = f"M{x + inner:g} {y:g}H{x + outer:g}A{outer:g} {outer:g} 0 0 0 {x:g} {y - outer:g}"
        return _path(kind, f"{d}V{y - inner:g}A{inner:g} {inner:g} 0 0 1 {x + inner:g} {y:g}z")

    inward = [math.radians(a) for a in (15, 35, 55, 75)]
    arrows = "".join(
        _arrow(130 + 172 * math.cos(a), 184 - 172 * math.sin(a), -24 * math.cos(a), 24 * math.sin(a)) for a in inward
    )
    contact = _path("skin", "M240 184A110 110 0 0 0 130 74")
    return "".join(
        (
            ring("master", 66, 110), ring("slave", 110, 146), contact, arrows, _arrow(130, 184, 66, 0, "edge"),
            _word(160, 178, "r₀"), _word(290, 40, "the outer ring", "start"),
            _word(290, 58, "is too narrow", "start"),
        )
    )  # fmt: skip


def _manufactured() -> str:
    wave = [(x, 128 - 16 * math.sin((x - 110) / 200 * math.pi)) for x in range(40, 381, 10)]
    low = [(x, y) for x, y in wave if 110 <= x <= 310]
    body = f"M310 40Q210 20 110 40L{_curve(low)}L310 128z"
    return "".join(
        (
            _path("slave", body), _path("master", f"M{_curve(wave)}L380 170H40z"), _path("skin", f"M{_curve(low)}"),
            _box("bare dashed", 118, 14, 184, 84), _word(210, 78, "u, p given; loads follow"),
            _word(210, 158, "rigid, curved"), _word(322, 30, "at rest", "start"),
        )
    )  # fmt: skip


def _inf_sup() -> str:
    ends = (50.0, 140.0, 210.0, 300.0, 370.0)
    tall = (46.0, 70.0, 34.0, 58.0)
    out = [_path("slave", "M50 140H370V176H50z")]
    for left, right, height in zip(ends[:-1], ends[1:], tall, strict=True):
        out.append(_box("pressure", left, 140 - height, right - left, height))
        out.append(_path("mesh", f"M{(left + right) / 2:g} 140v36"))
    out.append(_path("skin", "M50 140H370"))
    out += [_dot((left + right) / 2, 140) for left, right in pairwise(ends)]
    out += [_dot(x, 140, "dot hollow") for x in ends]
    out += [
        _word(95, 84, "λ"),
        _word(210, 20, "one multiplier, and one node of its own"),
        _word(210, 38, "to each macro-element"),
    ]
    return "".join(out)


def _sliding() -> str:
    die = "M60 30H160V78Q150 104 110 104Q70 104 60 78z"
    again = "M230 30H330V78Q320 104 280 104Q240 104 230 78z"
    return "".join(
        (
            _box("master", 30, 104, 360, 66), _grid(30, 104, 360, 66, 9, 2), _path("slave", die),
            _path("bare dashed", again), _path("skin", "M60 78Q70 104 110 104Q150 104 160 78"),
            _arrow(170, 60, 50, 0), _arrow(110, 6, 0, 20), _ground(30, 170, 360), _word(195, 48, "slides"),
        )
    )  # fmt: skip


def _impact() -> str:
    return "".join(
        (
            _box("slave", 170, 30, 80, 110), _grid(170, 30, 80, 110, 2, 5), _path("skin", "M170 140H250"),
            _path("master", "M60 158H360V180H60z"), _ground(60, 180, 300), _arrow(300, 50, 0, 50), _word(330, 80, "v"),
            _arrow(150, 134, 0, -70), _word(128, 100, "c"), _word(210, 20, "a wave goes up and comes back"),
        )
    )  # fmt: skip


def _scaling() -> str:
    dots = [(90.0, 142.0), (160.0, 117.0), (230.0, 92.0), (300.0, 68.0)]
    return "".join(
        (
            _path("edge", "M60 20V170H380"), _path("load dashed", "M60 170L380 58"), _path("one", f"M{_curve(dots)}"),
            *(_dot(x, y) for x, y in dots), _word(380, 50, "slope 1", "end"), _word(220, 190, "log size"),
            f'<g transform="translate(44 95) rotate(-90)">{_word(0, 0, "log seconds")}</g>',
        )
    )  # fmt: skip


_DRAWN: dict[str, tuple[str, Callable[[], str]]] = {
    "cut": ("a triangle and a tetrahedron on the slave skin, cut so that the face has a node of its own", _cut),
    "patch": ("two blocks whose meshes do not match, pressed together by a uniform pressure", _patch),
    "balance": ("equal and opposite contact forces on the two sides of a curved interface", _balance),
    "hertz": ("two flat half-spaces with a parabolic clearance between them, and the elliptic pressure", _hertz),
    "hertz-engineering": ("a cylinder pressed on a block by a displacement given on its top", _hertz_engineering),
    "press-fit": ("a quarter of two concentric rings, the outer one too narrow for the inner", _press_fit),
    "manufactured": ("a block deformed onto a rigid curved surface, and the same block at rest", _manufactured),
    "inf-sup": ("a skin of four macro-elements, each with a constant multiplier and an inner node", _inf_sup),
    "sliding": ("a rounded die pressed on a block and drawn along it", _sliding),
    "impact": ("a bar that flies at a rigid wall, and the wave that goes up in it", _impact),
    "scaling": ("seconds against size, both as logarithms, beside a line of slope one", _scaling),
}


def style() -> str:
    """Rules of CSS for the drawings."""
    return files("verification.report").joinpath("drawings.css").read_text(encoding="utf-8")
