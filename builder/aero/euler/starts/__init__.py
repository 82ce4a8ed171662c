"""Where the march starts: the conical flow over a pointed tip, the flow behind a spherical one."""
