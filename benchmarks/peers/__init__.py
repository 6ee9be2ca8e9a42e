"""A cylinder on a block, by lacsolver and by other contact codes, on the same mesh."""
