"""Bus tools: send, replay, record, inject faults."""
