"""Campaigns: the flow over a vehicle at many flight conditions, solved once each, in parallel, and resumable.

Read in this order: :mod:`~builder.campaign.campaign_run` (what a vehicle file requests),
:mod:`~builder.campaign.campaign_run` (the campaign), :mod:`~builder.campaign.scheduling` (threads, processes or
:mod:`~builder.campaign.dask_workers`), :mod:`~builder.campaign.dask_workers` (one flow),
:mod:`~builder.campaign.journal` (finished flows on disk), :mod:`~builder.campaign.snapshots` (the result and its
file). On the result work :mod:`~builder.campaign.failures`, :mod:`~builder.campaign.snapshots` and
:mod:`~builder.campaign.field_export`.
"""
