"""The flow that is marched, and the cross-planes it is marched on."""
