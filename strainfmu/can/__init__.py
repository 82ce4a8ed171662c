"""The CAN bridge: strain frames in, coefficients out. State machines inside, threads and sockets at the edge."""
