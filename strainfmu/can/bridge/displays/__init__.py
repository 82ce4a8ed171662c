"""Messages to displays: results, layout of the gauges and pressure on the body, as datagrams of JSON."""
