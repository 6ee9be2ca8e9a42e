"""The turning model of a report: deformed bodies, and pressures on their skins, with a slider over time."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from lacmesh.mesh import Mesh
from lacmesh.scene.marks import Values
from lacmesh.view import Moment, page_text
from lacsolver.pictures.drawing import ContactPicture
from lacsolver.pictures.framing import with_skins
from lacsolver.results.results import Fields

#: height of the model's frame in the page, in pixels
_HIGH = 560


def model_frame(states: Sequence[tuple[Mesh, Fields]], pictures: Sequence[ContactPicture], title: str) -> str:
    """Return the viewer of a model as an element of HTML, a page of its own inside of the report.

    `states`: mesh and fields at each time; `pictures`: what is shown of them, to one scale and with one magnification.
    """
    moments: list[Moment] = []
    skins: list[str] = []
    shown = pictures[-1].mesh
    for picture in pictures:
        x = picture.mesh.points + picture.times * picture.u
        shown, value, skins = with_skins(picture.mesh, x, picture.zones, picture.on_faces)
        moments.append(Moment(f"t = {picture.fields.time:.6g}", x, value))
    scale = pictures[-1].scale
    none = np.zeros(shown.n_cells, bool)
    values = Values(scale.label, moments[-1].values, scale.low, scale.high, none, scale.ramp, on_skin=True)
    bodies = "ghost" if shown.dim == 3 else "solid"
    text = page_text(shown, slave=skins, values=values, moments=moments, explode=0.0, bodies=bodies, title=title)
    return (
        f'<iframe title="{escape(title, quote=True)}" srcdoc="{escape(text, quote=True)}" '
        f'style="width:100%;height:{_HIGH}px;border:1px solid var(--line);border-radius:8px"></iframe>'
    )
