"""TOML files of sections: what their entries may be, and how a file is read and refused in one line a fault."""
