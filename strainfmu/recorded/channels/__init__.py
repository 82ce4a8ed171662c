"""A recorder's channels, by channels.toml: which is which gauge, how values become strain, one raster of all."""
