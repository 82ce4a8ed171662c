"""PythonFMU slaves; :mod:`strainfmu.fmu.export` copies their source into the FMUs."""
