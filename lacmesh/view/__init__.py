"""Pictures of meshes and of their cuts, without a window: PNG files, and pages that turn in a browser.

scene = what is drawn, and from where               (`lacmesh.scene`)
image = the scene drawn by pyvista                  (`png`; `draw`, in a subprocess that `offscreen` starts)
frames = bodies at several times, drawn in the same way                 (`png`)
page = the same faces and a small viewer            (`page`, `page.html`: one file that opens offline)
"""

from lacmesh.view.page import Moment, page, page_text
from lacmesh.view.png import frames, image_of, picture, thumbnail

__all__ = ["Moment", "frames", "image_of", "page", "page_text", "picture", "thumbnail"]
