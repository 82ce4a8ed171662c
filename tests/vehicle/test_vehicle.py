"""The vehicle file: what it means, and that every fault is one line that names the entry."""

from math import degrees, pi, radians, tan
from pathlib import Path

import pytest
from changed_vehicle import load_changed, write_changed

from builder.structure.gauge_checks import check_gauges
from builder.structure.wall import wall_of
from builder.trial.conditions import largest_incidence
from builder.vehicle.file import IC3X, load_vehicle
from builder.vehicle.map_needs import unused_entries, used_layouts
from strainfmu.errors import InputError

FIRST_CONE = 'kind = "cone"\nhalf_angle_deg = 5.0\nend_x_m = 1.75'
LAYOUTS = r"\['configuration_1', 'configuration_2', 'configuration_45'\]"


@pytest.mark.fast
def test_shipped_vehicle() -> None:
    """The surrogate's numbers, the set P1 of 90 conditions in the file's order, and three layouts."""
    vehicle = load_vehicle(IC3X)
    assert "surrogate" in vehicle.name
    radius = 1.75 * tan(radians(5.0)) + 1.85 * tan(radians(1.0))
    reference = vehicle.reference_quantities()
    assert reference.area == pytest.approx(pi * radius**2, rel=1e-12)
    assert reference.length == pytest.approx(2.0 * radius, rel=1e-12)
    assert reference.moment_station == 2.0
    conditions = vehicle.flight_conditions()
    assert len(conditions) == 90
    assert {c.mach_number for c in conditions} == {5.0, 5.5, 6.0, 6.5, 7.0}
    assert [degrees(c.sideslip_angle) for c in conditions[:3]] == pytest.approx([0.0, 5.0, 10.0])
    assert degrees(conditions[3].angle_of_attack) == pytest.approx(2.0)
    assert {c.altitude for c in conditions} == {20e3}
    assert check_gauges(vehicle) == {"configuration_1": 27, "configuration_2": 54, "configuration_45": 54}
    assert used_layouts(vehicle) == ["configuration_2"]
    wall = wall_of(vehicle)
    assert (wall.thickness, wall.material.youngs_modulus) == pytest.approx((4e-3, 110e9))
    assert vehicle.beside("a.csv") == IC3X.parent / "a.csv"


@pytest.mark.fast
def test_distinct_flows_of_the_set() -> None:
    """17 total incidences per Mach number: 85 flows, the largest at 14.106 deg."""
    incidences = {(c.mach_number, round(c.total_incidence, 9)) for c in load_vehicle(IC3X).flight_conditions()}
    assert len(incidences) == 85
    assert degrees(max(angle for _, angle in incidences)) == pytest.approx(14.106, abs=5e-4)


@pytest.mark.fast
def test_internal_pressure(tmp_path: Path) -> None:
    """Vented: p_inf of the condition (20 km: 5474.9 Pa); or a number."""
    vented = load_vehicle(IC3X)
    condition = vented.flight_conditions()[0]
    assert vented.structure.internal_pressure([condition]) == pytest.approx(5474.9, abs=0.05)
    sealed = load_changed(tmp_path, ('internal_pressure_Pa = "ambient"', "internal_pressure_Pa = 9.0e4"))
    assert sealed.structure.internal_pressure([condition]).tolist() == [9e4]


@pytest.mark.fast
def test_reference_area_and_length_may_be_given(tmp_path: Path) -> None:
    changed = load_changed(
        tmp_path, ("moment_station_m = 2.0", "moment_station_m = 1.5\narea_m2 = 0.2\nlength_m = 0.5")
    )
    reference = changed.reference_quantities()
    assert (reference.area, reference.length, reference.moment_station) == (0.2, 0.5, 1.5)


@pytest.mark.fast
def test_arc_is_an_ogive(tmp_path: Path) -> None:
    arc = 'kind = "arc"\nstart_half_angle_deg = 10.0\nend_half_angle_deg = 1.0\nend_x_m = 1.75'
    body = load_changed(tmp_path, (FIRST_CONE, arc)).body()
    assert degrees(body.tip_angle) == pytest.approx(10.0)
    assert len(body.slope_breaks) == 0


@pytest.mark.fast
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "wall_thickness_mm",
            "wall_thickness_m",
            r"wall_thickness_m: unknown entry \(wrong unit\?\), allowed is wall_thickness_mm",
        ),
        (
            "youngs_modulus_GPa",
            "youngs_modulus_MPa",
            r"material.youngs_modulus_MPa: .*allowed is youngs_modulus_GPa",
        ),
        (FIRST_CONE, FIRST_CONE.replace("_deg", "_rad"), r"profile.1.half_angle_rad: .*allowed is half_angle_deg"),
        ("first_x_m = 0.35", "first_x_mm = 350.0", r"rows.1.first_x_mm: .*allowed is first_x_m"),
        ("altitude_km = 20.0", "altitude_ft = 65617.0", r"conditions.altitude_ft: .*allowed is altitude_km"),
        ("poisson_ratio", "poison_ratio", r"material.poison_ratio: unknown entry, did you mean poisson_ratio\?"),
        (
            'engine = "euler"',
            'engine = "eular"',
            r"aerodynamics.engine: expected one of euler, newtonian, table, got 'eular'",
        ),
        (
            'engine = "euler"',
            'surfaces = "a.stl"',
            r"aerodynamics.surfaces: unknown entry, did you mean surface\?",
        ),
        ("[map]", "[mapp]", r"mapp: unknown entry, did you mean map\?"),
        ("modes = 5", "modes = 5\nzzz = 1", r"map.zzz: unknown entry; allowed: form, symmetry, "),
        (
            "wall_thickness_mm = 4.0",
            "wall_thickness_mm = -4.0",
            r"structure.wall_thickness_mm: expected 0.01 .. 1000, got -4.0",
        ),
        (
            "wall_thickness_mm = 4.0",
            'wall_thickness_mm = "4.0"',
            r"structure.wall_thickness_mm: expected a number, 0.01 .. 1000, got '4.0'",
        ),
        (
            "wall_thickness_mm = 4.0",
            "wall_thickness_mm = nan",
            r"structure.wall_thickness_mm: expected 0.01 .. 1000, got nan",
        ),
        (
            "wall_thickness_mm = 4.0",
            "wall_thickness_mm = inf",
            r"structure.wall_thickness_mm: expected 0.01 .. 1000, got inf",
        ),
        ("wall_thickness_mm = 4.0", "", r"structure.wall_thickness_mm: entry is missing"),
        (
            "poisson_ratio = 0.31",
            "poisson_ratio = 0.5",
            r"material.poisson_ratio: expected 0 .. 0.499, got 0.5",
        ),
        (
            'layout = "configuration_2"',
            'layout = "other"',
            rf"gauges: layout 'other' is not among the layouts {LAYOUTS}",
        ),
        (
            'of_layout = "configuration_2"',
            'of_layout = "other"',
            rf"noise.of_layout 'other' is not among the layouts {LAYOUTS}",
        ),
        ("end_x_m = 3.6", "end_x_m = 1.6", r"profile segment 2: end_x_m 1.6 must lie aft of 1.75"),
        (
            "half_angle_deg = 1.0",
            "half_angle_deg = -10.0",
            r"profile segment 2: the radius falls to zero before x = 3.6 m",
        ),
        (
            "half_angle_deg = 5.0",
            "half_angle_deg = 50.0",
            r"profile.1.half_angle_deg: expected -45 .. 45, got 50.0",
        ),
        (
            "harmonics = 16",
            "harmonics = 36",
            r"resolution.map: harmonics: expected less than half of surface_roll_angles 72, got 36",
        ),
        (
            "radial_cells = 24",
            "radial_cells = 4",
            r"resolution.map.radial_cells: expected 8 .. 400, got 4",
        ),
        ("modes = 5", "modes = 5.0", r"map.modes: expected a whole number, 1 .. 1000, got 5.0"),
        ("modes = 5", "modes = 0", r"map.modes: expected 1 .. 1000, got 0"),
        (
            "mach_number = [5.0, 5.5",
            "mach_number = [5.0, 0.5",
            r"conditions.mach_number.2: expected 1.01 .. 30, got 0.5",
        ),
        (
            "altitude_km = 20.0",
            "altitude_km = 72.0",
            r"conditions.altitude_km: expected 0 .. 71, or a list of such numbers, got 72.0",
        ),
        (
            "altitude_km = 20.0",
            "altitude_km = [20.0, 72.0]",
            r"conditions.altitude_km: expected 0 .. 71, or a list of such numbers, got 72.0",
        ),
        (
            "altitude_km = 20.0",
            "altitude_km = [20.0, 20]",
            r"conditions.altitude_km: expected each value once, got 20 more than once",
        ),
        (
            "altitude_km = 20.0",
            "altitude_km = []",
            r"conditions.altitude_km: expected at least 1 value, got \[\]",
        ),
        ("count = 9", "count = 1", r"configuration_1.rows.1.count: expected 2 .. 1000, got 1"),
        (
            "last_x_m = 3.30, ",
            "",
            r"rows.1: stations must be given either as x_m or as first_x_m, last_x_m and count",
        ),
        (
            '["axial", "hoop"]',
            '["axial", "shear"]',
            r"rows.1.directions.2: expected 'axial' or 'hoop', got 'shear'",
        ),
        (
            "percent_of_median_strain = 1.0",
            "percent_of_median_strain = 1.0\nstd_um_per_m = 0.4",
            r"noise: give either",
        ),
        ("percent_of_median_strain = 1.0", "", r"noise: give either percent_of_median_strain or std_um_per_m"),
        (
            'support = "clamped_aft"',
            'support = "free"',
            r"support: expected 'clamped_aft', 'elastic_foundation' or 'free_flight', got 'free'",
        ),
        (
            'support = "clamped_aft"',
            'support = "elastic_foundation"\nfoundation_normal_N_per_m3 = 1e9',
            "structure: support 'elastic_foundation' needs foundation_normal_N_per_m3 and foundation_tang",
        ),
        (
            'support = "clamped_aft"',
            'support = "elastic_foundation"\nfoundation_normal_N_per_m3 = -1.0',
            "structure.foundation_normal_N_per_m3: expected 1000 .. 1e\\+18, got -1.0",
        ),
        (
            'support = "clamped_aft"',
            'support = "clamped_aft"\nfoundation_normal_N_per_m3 = 1e9',
            "structure: foundation stiffness found with support 'clamped_aft', it has no foundation",
        ),
        ('model = "fourier"', 'model = "shell"', "structure.model: expected 'fourier' or 'solid', got 'shell'"),
        (
            'resolution = "medium"',
            'resolution = "fine"',
            "structure.resolution: expected 'paper', 'medium' or 'coarse', got 'fine'",
        ),
        (
            "density_kg_per_m3 = 4430.0",
            "density_g_per_cm3 = 4.43",
            r"material.density_g_per_cm3: unknown entry.*density_kg_per_m3",
        ),
        (
            "density_kg_per_m3 = 4430.0",
            "density_kg_per_m3 = 0.0",
            "material.density_kg_per_m3: expected 10 .. 30000, got 0.0",
        ),
        (
            "{ roll_angle_deg = 180.0,",
            '{ roll_angle_deg = 180.0, surface = "inside",',
            "rows.1.surface: expected 'inner' or 'outer', got 'inside'",
        ),
        (
            "{ roll_angle_deg = 180.0,",
            "{ roll_angle_deg = 180.0, length_mm = -1.0,",
            "rows.1.length_mm: expected 0 .. 100, got -1.0",
        ),
        (
            "[gauges.layouts.configuration_1]",
            "[gauges.layouts.configuration_1]\nlength_mm = 3.0",
            "layouts.configuration_1: surface and length_mm belong in each row",
        ),
        ("[structure]", "[structure", r"not a TOML file"),
    ],
)
def test_fault_is_one_line_that_names_the_entry(old: str, new: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words) as error:
        load_changed(tmp_path, (old, new))
    message = str(error.value)
    assert message.startswith(f"{tmp_path / 'vehicle.toml'}: ")
    assert "\n" not in message


@pytest.mark.fast
def test_misspelt_key_is_one_fault(tmp_path: Path) -> None:
    """It leaves its right name missing, which is not said again; another missing entry is."""
    with pytest.raises(InputError, match=r"wall_thickness_m: unknown entry.*allowed is wall_thickness_mm$"):
        load_changed(tmp_path, ("wall_thickness_mm", "wall_thickness_m"))
    with pytest.raises(InputError, match=r"wall_thickness_m: unknown[^\n]*\n.*poisson_ratio: entry is missing$"):
        load_changed(tmp_path, ("wall_thickness_mm", "wall_thickness_m"), ("poisson_ratio = 0.31", "#"))
    with pytest.raises(InputError, match=r"solid_tip_length_m: entry is missing$"):
        load_changed(tmp_path, ("solid_tip_length_m = 0.10 ", "#"))


def test_layout_of_rows_and_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="configuration_1: a layout needs either rows or file"):
        load_changed(
            tmp_path, ("[gauges.layouts.configuration_1]", '[gauges.layouts.configuration_1]\nfile = "a.csv"')
        )


@pytest.mark.fast
def test_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none.toml: no such file"):
        load_vehicle(tmp_path / "none.toml")
    with pytest.raises(InputError, match="cannot be read"):
        load_vehicle(tmp_path)
    path = tmp_path / "latin.toml"
    path.write_bytes("name = 'Flügel'".encode("latin-1"))
    with pytest.raises(InputError, match="not a TOML file"):
        load_vehicle(path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('kind = "cone"\n', "", ("profile.1.kind", "missing", "'cone', 'arc', ")),
        ('kind = "cone"\n', 'kind = "ball"\n', ("profile.1.kind", "expected 'cone', 'arc', ", "got 'ball'")),
        (
            '= "ambient" # "ambient"',
            "= -1.0 #",
            ("internal_pressure_Pa", "expected 'ambient' or 0 .. 1e+08", "got -1.0"),
        ),
        ('= "ambient" # "ambient"', '= "vacuum" #', ("internal_pressure_Pa", "got 'vacuum'")),
        (
            "mach_number = [5.0, 5.25, 5.75,",
            "mach_number = [5.0, 5.25, 5.25,",
            ("truth.mach_number", "each value once", "got 5.25"),
        ),
        ("sideslip_angle_deg = [0.0, 5.0, 10.0]", "sideslip_angle_deg = []", ("at least 1 value", "got []")),
    ],
)
def test_lines_that_pydantic_would_make_unreadable(
    tmp_path: Path, old: str, new: str, words: tuple[str, ...]
) -> None:
    path = write_changed(tmp_path, (old, new))
    with pytest.raises(InputError) as error:
        load_vehicle(path)
    for word in words:
        assert word in str(error.value)
    assert "\n" not in str(error.value)


def test_the_truth_of_the_shipped_vehicle_goes_as_far_as_its_snapshots() -> None:
    """Alarm levels are set over the whole envelope: tables err most where snapshots are sparse."""
    shipped = load_vehicle(IC3X)
    assert radians(max(shipped.truth.total_incidence_deg)) >= largest_incidence(shipped)


@pytest.mark.fast
def test_entries_that_the_map_does_not_use_are_named(tmp_path: Path) -> None:
    """Of the nonlinear estimator with the linear one, of Case 2 with Case 1; what stands by default is not."""
    text = IC3X.read_text(encoding="utf-8")
    assert not list(unused_entries(load_vehicle(IC3X)))
    both = 'estimator = "nonlinear"'
    for old, new, named in (
        (both, 'estimator = "linear"\ndiscrepancy_percent = 1.0', ["map.discrepancy_percent"]),
        (both, "discrepancy_length = 0.3", []),
        (both, 'form = "absolute"\ndiscrepancy_length = 0.3', ["map.discrepancy_length"]),
        (both, "prior_modes = 20", ["map.prior_modes"]),
        (both, "case = 2\nprior_modes = 20", []),
    ):
        assert old in text
        path = tmp_path / "vehicle.toml"
        path.write_text(text.replace(old, new), encoding="utf-8")
        lines = list(unused_entries(load_vehicle(path)))
        assert [line.partition(": not used")[0] for line in lines] == named


@pytest.mark.fast
@pytest.mark.parametrize(
    ("section", "entries", "message"),
    [
        ("map", {"modes": "many"}, "MapEntry: modes: expected a whole number, 1 .. 1000, got 'many'"),
        (
            "map",
            {"estimator": "manifold"},
            "MapEntry: estimator: expected 'auto', 'linear' or 'nonlinear', got 'manifold', now called 'nonlin",
        ),
        ("map", {"estimator": "kalman"}, "estimator: expected 'auto', 'linear' or 'nonlinear', got 'kalman'"),
        ("map", {"modes": 0}, "MapEntry: modes: expected 1 .. 1000, got 0"),
        ("map", {"modess": 3}, "MapEntry: modess: unknown entry, did you mean modes?"),
        ("map", {"case": 2, "gamma": 3.0}, "MapEntry: gamma: expected 1 with form 'dynamic_pressure', got 3"),
        ("noise", {"std_um_per_m": float("nan")}, "Noise: std_um_per_m: expected .*, got nan"),
        ("conditions", {"mach_number": [5.0, 5.0]}, "Conditions: mach_number: expected each value once"),
    ],
)
def test_a_copy_with_a_wrong_entry_is_refused(section: str, entries: dict[str, object], message: str) -> None:
    """As the entry of a file is: in one line that names it."""
    with pytest.raises(InputError, match=message) as caught:
        getattr(load_vehicle(IC3X), section).model_copy(update=entries)
    assert len(caught.value.lines) == 1


@pytest.mark.fast
def test_a_copy_of_a_vehicle_is_checked_as_a_whole() -> None:
    """Sections that do not fit each other are refused; a right copy keeps the folder of the file."""
    vehicle = load_vehicle(IC3X)
    with pytest.raises(InputError, match=r"Vehicle: structure\.support 'free_flight' needs material\.density"):
        vehicle.model_copy(
            update={
                "structure": vehicle.structure.model_copy(update={"support": "free_flight"}),
                "material": vehicle.material.model_copy(update={"density_kg_per_m3": None}),
            }
        )
    with pytest.raises(InputError, match="Vehicle: map: expected a section, got 5"):
        vehicle.model_copy(update={"map": 5})
    fewer = vehicle.model_copy(update={"map": vehicle.map.model_copy(update={"modes": 3})})
    assert fewer.map.modes == 3
    assert vehicle.map.modes == 5
    assert fewer.beside("a.csv") == IC3X.parent / "a.csv"
    assert vehicle.model_copy(deep=True) == vehicle
