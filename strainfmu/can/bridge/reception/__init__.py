"""Reception: frames from the bus into a bounded queue, and what is skipped when they wait too long."""
