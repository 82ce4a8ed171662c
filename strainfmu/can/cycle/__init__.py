"""The cycle: frames accepted, assembled, judged and answered, in any time, without threads and sockets."""
