"""A live view of the bridge in a browser: a process of its own, fed by datagrams."""
