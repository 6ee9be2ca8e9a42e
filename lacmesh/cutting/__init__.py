"""The cut of a slave skin, from the faces that are listed to the mesh after it, and the records that it leaves."""
