"""The C run-time of the native FMU and its libraries, built by :mod:`strainfmu.fmu.native.build`."""
