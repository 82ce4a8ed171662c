"""The vehicle in three dimensions with values at its nodes and its gauges: stills and files of scenes."""
