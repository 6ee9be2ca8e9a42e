"""Meshes and cuts for other libraries and programs: meshio, pyvista, trimesh, code_aster."""
