"""The stages from a vehicle file to a map and a demonstration, in memory and from file to file.

:mod:`~builder.pipeline.stages` holds the stages in memory, :mod:`~builder.pipeline.pipeline` what makes files of
stages in a folder. On them :mod:`~builder.pipeline.map_files`, :mod:`~builder.pipeline.calibrate`,
:mod:`~builder.pipeline.load_test_proposal` and :mod:`~builder.pipeline.demonstration`.
"""
