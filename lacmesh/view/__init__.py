"""Pictures of meshes and of their cuts, without a window: PNG files, and pages that turn in a browser.

scene = what is drawn, and from where               (`lacmesh.scene`)
image = the scene drawn by pyvista                  (`png`; `draw`, in a subprocess that `offscreen` starts)
page = the same faces and a small viewer            (`page`, `page.html`: one file that opens offline)
"""

from lacmesh.view.page import page
from lacmesh.view.png import picture, thumbnail

__all__ = ["page", "picture", "thumbnail"]
