"""The pressure fields a map is built on, at every roll angle they are valid at, and their POD modes."""
