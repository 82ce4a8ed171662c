"""Reports: tables that hold raw numbers, pages of HTML that need no other file, and what they say of a map.

:mod:`~builder.reports.page` is what all pages are made of, :mod:`~builder.reports.findings` what is found of a
map, :mod:`~builder.reports.build_report` the report of a build. Beside it the reports of a calibration and of a
mesh study.
"""
