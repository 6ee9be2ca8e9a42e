"""Bodies under small and finite strains: internal forces, tangents, stresses."""
