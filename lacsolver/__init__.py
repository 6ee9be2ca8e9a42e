"""Contact between elastic bodies by the Local Average Contact method: mesh, space, assemble, pair, solve, results."""
