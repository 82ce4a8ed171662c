# ruff: noqa: I001 - grouped as the page of the Python reference

# Vehicle
from builder.vehicle.file import IC3X as IC3X
from builder.vehicle.file import VEHICLES as VEHICLES
from builder.vehicle.file import Vehicle as Vehicle
from builder.vehicle.file import load_vehicle as load_vehicle

# Commands
from builder.pipeline.demonstration.demo import demo as demo
from builder.pipeline.vehicle_check import check as check
from builder.pipeline.map_files import build as build
from builder.pipeline.flow_files import snapshots as snapshots
from builder.pipeline.flow_files import surface as surface
from builder.pipeline.structure_run import run_structure as run_structure
from builder.pipeline.structure_run import export_loads as export_loads
from builder.pipeline.structure_run import export_influence as export_influence
from builder.campaign.field_export import convert as convert
from builder.figures.picture_files import picture as picture
from builder.pipeline.load_test_proposal import loadtest as loadtest
from builder.pipeline.load_test_proposal import loadtest_template as loadtest_template
from builder.pipeline.calibrate import calibrate as calibrate
from builder.pipeline.equations import equations as equations
from builder.pipeline.place_and_review import place as place
from builder.pipeline.place_and_review import review as review
from builder.pipeline.trials import run_trial as run_trial
from builder.pipeline.trials import stress as stress
from builder.pipeline.trials import compare as compare
from builder.study import run_study as run_study
from builder.reproduce.reproduction import reproduce_paper as reproduce_paper
from builder.structure.loads.of_vehicle import known_strain as known_strain
from builder.reports.mesh_study import bench_meshes as bench_meshes
from builder.pipeline.gauge_growth import bench_gauges as bench_gauges
from builder.reports.growth import bench_structure as bench_structure
from builder.figures.flight import flight_figures as flight_figures
from builder.reports.flight_page import write_flight_page as write_flight_page
from builder.pipeline.recordings import estimate_recordings as estimate_recordings

# Map
from builder.pipeline.stages import build_map as build_map
from builder.pipeline.stages import solve_structure as solve_structure
from builder.pipeline.stages import take_snapshots as take_snapshots
from builder.campaign.snapshots import Snapshots as Snapshots
from builder.campaign.snapshots import load_snapshots as load_snapshots
from builder.campaign.snapshots import save_snapshots as save_snapshots

# Flow
from builder.aero.euler.bodies.solver import solve_flow as solve_flow
from builder.aero.euler.planes import MarchingGrid as MarchingGrid
from builder.vehicle.shape.geometry import chain_segments as chain_segments
from builder.aero.surface.mesh import mesh_of_grid as mesh_of_grid

# What gauges observe
from builder.structure.observability import smooth_response as smooth_response
from builder.structure.observability import symmetry_responses as symmetry_responses

# Known loads
from builder.structure.loads.applied import PadForce as PadForce
from builder.structure.loads.applied import PointForce as PointForce
from builder.structure.loads.applied import SectionLoad as SectionLoad
from builder.structure.loads.applied import SurfacePressure as SurfacePressure
from builder.structure.loads.applied import Weight as Weight
from builder.structure.loads.fourier import fourier_structure as fourier_structure
from builder.structure.loads.gauge_strain import gauge_strain as gauge_strain
from builder.structure.loads.gauge_strain import load_resultant as load_resultant
from builder.structure.loads.of_vehicle import fourier_structure_of as fourier_structure_of
from builder.structure.loads.solid import solid_structure_of as solid_structure_of
from builder.structure.loads.loaded_structure import LoadProperties as LoadProperties
from builder.structure.loads.temperature import temperature_mode as temperature_mode
from builder.structure.fourier.inner_surface import PlacedGauges as PlacedGauges
from builder.structure.fourier.meridian_mesh import tube_mesh as tube_mesh
from builder.structure.wall import Material as Material

# Ground test
from builder.calibration.ground_test.candidate_cases import PlannedCase as PlannedCase
from builder.calibration.ground_test.load_test import LoadErrors as LoadErrors
from builder.calibration.ground_test.load_test_file import read_test_file as read_test_file
from builder.calibration.ground_test.ground_test_readings import read_load_test as read_load_test
from builder.calibration.score.simulated_test import simulate_ground_test as simulate_ground_test
from builder.calibration.score.simulated_test import write_ground_test as write_ground_test
from builder.calibration.score.simulated_test import standard_load_cases as standard_load_cases
from builder.structure.as_built.as_built_structure import as_built_structure as as_built_structure
from builder.structure.as_built.as_built_vehicle import as_built_std as as_built_std
from builder.structure.as_built.as_built_vehicle import draw_as_built as draw_as_built

# Reports
from builder.reports.page.html import Page as Page
from builder.reports.page.html import Paragraph as Paragraph
from builder.reports.page.html import Section as Section
from builder.reports.page.html import write_page as write_page
from builder.reports.page.page_tables import Column as Column
from builder.reports.page.page_tables import make_table as make_table
