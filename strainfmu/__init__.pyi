# ruff: noqa: I001 - grouped as the page of the Python reference

from strainfmu.version import __version__ as __version__

# Maps
from strainfmu.cli.inspection.files import inspect as inspect
from strainfmu.estimator.map.inverse_map import InverseMap as InverseMap
from strainfmu.estimator.map.inverse_map import load_inverse_map as load_inverse_map
from strainfmu.estimator.map.inverse_map import save_inverse_map as save_inverse_map
from strainfmu.linear.linear_map import LinearMap as LinearMap
from strainfmu.linear.linear_map import linear_map as linear_map
from strainfmu.linear.pressure_modes import proper_orthogonal_decomposition as proper_orthogonal_decomposition

# Estimate
from strainfmu.estimator.estimator import Estimator as Estimator
from strainfmu.estimator.estimator import load as load
from strainfmu.estimator.estimate import Estimate as Estimate
from strainfmu.estimator.settings import EstimatorSettings as EstimatorSettings
from strainfmu.estimator.air_data import AirData as AirData
from strainfmu.estimator.air_inputs import QSource as QSource
from strainfmu.estimator.health import HealthState as HealthState

# Zero offsets
from strainfmu.estimator.gauge_zeros import GaugeZeros as GaugeZeros
from strainfmu.estimator.tare import KnownStrain as KnownStrain
from strainfmu.estimator.tare import Tare as Tare
from strainfmu.estimator.tare import TareLimits as TareLimits
from strainfmu.cosim.estimators.zeros_file import load_zeros as load_zeros

# Recordings
from strainfmu.any_recording import estimate as estimate
from strainfmu.recorded.channel_draft import channels as channels
from strainfmu.recorded.tare_window import tare as tare
from strainfmu.recorded.run import estimate_file as estimate_file

# FMUs
from strainfmu.packaging.packages import export as export
from strainfmu.packaging.packages import plant as plant
from strainfmu.fmu.checks.crosscheck import crosscheck as crosscheck
from strainfmu.fmu.flight_export import fly as fly
from strainfmu.cli.bench import bench as bench
from strainfmu.cli.peers import bench_peers as bench_peers
from strainfmu.fmu.checks.worst_step import bench_worst as bench_worst
from strainfmu.fmu.export import ExportOptions as ExportOptions
from strainfmu.fmu.export import export_estimator as export_estimator
from strainfmu.fmu.plant_export import export_can_bus as export_can_bus
from strainfmu.cosim.systems.system import Connection as Connection
from strainfmu.cosim.systems.system import System as System
from strainfmu.cosim.systems.master import matching_connections as matching_connections
from strainfmu.cosim.systems.master import simulate as simulate
from strainfmu.cosim.systems.recording import Recording as Recording
from strainfmu.cosim.systems.recording import load_recording as load_recording

# Bus
from strainfmu.can.commands import bridge as bridge
from strainfmu.can.commands import dbc as dbc
from strainfmu.can.commands import dbc_template as dbc_template
from strainfmu.can.commands import send as send
from strainfmu.can.commands import replay as replay
from strainfmu.monitor.server import serve_monitor as serve_monitor
from strainfmu.can.load_listener import LoadListener as LoadListener
from strainfmu.can.profiles import profile_layout as profile_layout
from strainfmu.can.encoder import StrainEncoder as StrainEncoder
from strainfmu.can.frame import crc_of as crc_of

# Errors
from strainfmu.errors import InputError as InputError
from strainfmu.errors import StrainfmuError as StrainfmuError
