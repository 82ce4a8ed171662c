"""From tip to base: the walls that the march follows, convex corners, half a body or all round it."""
