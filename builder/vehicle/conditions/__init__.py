"""Flight conditions at which snapshots are taken, and further parameters of the flow such as deflections."""
