"""The turning model of a report: the deformed bodies at the last time, and pressures on their skins."""

from __future__ import annotations

from html import escape
from importlib.util import find_spec

from lacmesh.view import check_renderer, page_of
from lacsolver.pictures.drawing import ContactPicture

#: height of the model's frame in the page, in pixels
_HIGH = 560


def model_frame(picture: ContactPicture, title: str) -> str:
    """Return the model of a picture, to be turned in a page of its own inside of the report, as an element of HTML.

    A sentence in its place where trame-pyvista is not installed. Raises WriteError where nothing can be drawn.
    """
    if find_spec("pyvista") is None or find_spec("trame_pyvista") is None:
        return "<p>A model that turns needs trame-pyvista; pip install 'lacmesh[view]' brings it.</p>"
    check_renderer()
    drawing = picture.drawing(picture.mesh.points + picture.times * picture.u, (1200, _HIGH))
    return (
        f'<iframe title="{escape(title, quote=True)}" srcdoc="{escape(page_of(drawing.plot), quote=True)}" '
        f'style="width:100%;height:{_HIGH}px;border:1px solid var(--line);border-radius:8px"></iframe>'
    )
