"""Tools around the bridge: send strains, inject faults, record, replay, export a DBC file."""
