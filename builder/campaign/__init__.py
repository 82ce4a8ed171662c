"""Campaigns: the flow over a vehicle at many flight conditions, solved once each, in parallel, and resumable."""
