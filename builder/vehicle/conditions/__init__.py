"""Flight conditions at which snapshots are taken, and flow parameters such as deflections."""
