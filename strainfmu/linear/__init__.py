"""The paper's linear inverse map: modes of snapshots, the map from strain to them, the choice of gamma."""
