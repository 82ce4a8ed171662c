"""Systems of FMUs: instances, their connections, the master that steps them, recordings, SSP packages."""
