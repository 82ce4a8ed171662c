"""File formats, one a module: surfaces and points read with their values, the vehicle's surface written."""
