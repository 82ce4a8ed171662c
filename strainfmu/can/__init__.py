"""The CAN bridge: strain frames in, coefficients out.

A frame comes as a message of python-can (``listener``) or of a log (``log_frames``) to the compiled ``machine``,
whose ``plan`` follows from a profile (``profiles``) or a user's DBC file (``dbc_mapping``). Results go out as
frames (``result_frames``), to a page (``publisher``) and into columns (``replay``). ``bridge`` is a listener with
a loop, ``bus_file`` describes all of it, ``commands`` are what a user calls.
"""
