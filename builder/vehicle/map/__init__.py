"""Options of the map: sections [map], [noise] and [calibration], and the rules that find gamma."""
