"""The compiled finite-volume scheme: gas, moving grid, states at faces, fluxes, bow shock, the march of planes."""
