"""Files that others give, a few of their bytes changed: each ends within 10 s and 1 GiB, in one line.

Every kind is tried 500 times slowly, and a few times in each run.
"""

import io
import random
import zipfile
from collections.abc import Callable
from pathlib import Path

import can
import pytest
from bus_run import CYCLE, flight
from can_case import OWN, dbc_text_of
from fault_injection import FaultySender
from limited_process import Ended, limited_run
from mf4_files import write_bus_log
from mutations import mutated
from recorded_case import NAMES, samples
from sweeps import sweep
from synthetic_vehicle import SyntheticFiles

from strainfmu.can.frame import to_message
from strainfmu.can.profiles import Identifiers, profile_layout

START = 1_700_000_000.0
N_CYCLES = 40
PERIOD = f"input.cycle_time_ms={1e3 * CYCLE:g}"

LOGS = ("blf", "asc", "mf4", "log", "trc", "csv")

Try = Callable[[Path], Ended]


def profile_in(suffix: str) -> str:
    """Return the profile of a log: not every format holds CAN FD."""
    return "classic-le" if suffix in (".trc", ".csv") else "fd64"


def write_log(path: Path) -> Path:
    """Write a flight in the format of the suffix, as fd64 where that holds CAN FD."""
    layout = profile_layout(profile_in(path.suffix), NAMES, cycle_time=CYCLE, identifiers=Identifiers())
    sender = FaultySender(layout, [], OWN)
    frames = [
        frame
        for k, sample in enumerate(flight(N_CYCLES))
        for frame in sender.cycle(k, k * CYCLE, sample.strain, sample.dynamic_pressure)
    ]
    for frame in frames:
        frame.time += START
    if path.suffix == ".mf4":
        return write_bus_log(path, [(frame, True) for frame in frames])
    with can.Logger(str(path)) as log:
        for frame in frames:
            message = to_message(frame)
            message.timestamp = frame.time
            log.on_message_received(message)
    return path


def log_case(suffix: str, synthetic: SyntheticFiles, folder: Path) -> tuple[bytes, Path, Try]:
    path = write_log(folder / f"run.{suffix}")
    output = folder / "o.csv"
    return (
        path.read_bytes(),
        path,
        lambda log: limited_run(
            folder,
            *("replay", log, synthetic.map_1, "-o", output, "--profile", profile_in(path.suffix)),
            *("--set", PERIOD),
        ),
    )


def dbc_case(synthetic: SyntheticFiles, folder: Path) -> tuple[bytes, Path, Try]:
    path, bus = folder / "rack.dbc", folder / "bus.toml"
    path.write_text(dbc_text_of("fd64", len(NAMES)))
    strains = "".join(f'"{name}" = "Strain1.gauge_{k}"\n' for k, name in enumerate(NAMES))
    bus.write_text(
        '[bus]\ninterface = "virtual"\nchannel = "x"\n[input]\ndbc = "rack.dbc"\ncycle_time_ms = 10\n'
        f'[input.strain]\n{strains}[input.dynamic_pressure]\nsignal = "DynamicPressure.DynamicPressure"\n'
    )
    log = write_log(folder / "run.blf")
    return (
        path.read_bytes(),
        path,
        lambda _: limited_run(folder, "replay", log, synthetic.map_1, "-o", folder / "o.csv", "--bus", bus),
    )


def hdf5_case(synthetic: SyntheticFiles, folder: Path) -> tuple[bytes, Path, Try]:
    import h5py

    path = folder / "run.h5"
    time, strain, pressure = samples(60)
    with h5py.File(path, "w") as file:
        file["time"], file["strain"], file["dynamic_pressure"] = time, strain, pressure
        file["gauge_names"] = NAMES
        file["strain"].attrs["unit"] = "m/m"
    return (
        path.read_bytes(),
        path,
        lambda one: limited_run(folder, "estimate", synthetic.map_1, one, "-o", folder / "o.csv"),
    )


def fmu_case(synthetic: SyntheticFiles, folder: Path) -> tuple[bytes, Path, Try]:
    path, log = folder / "mutated.fmu", write_log(folder / "run.blf")
    return (
        synthetic.estimator_1.read_bytes(),
        path,
        lambda one: limited_run(
            folder, "replay", log, one, "-o", folder / "o.csv", "--profile", "fd64", "--set", PERIOD
        ),
    )


def case_of(kind: str, synthetic: SyntheticFiles, folder: Path) -> tuple[bytes, Path, Try]:
    """Return the bytes of a sound file, where its mutations are written, and what reads them."""
    if kind in LOGS:
        if kind == "mf4":
            pytest.importorskip("asammdf")
        return log_case(kind, synthetic, folder)
    return {"dbc": dbc_case, "hdf5": hdf5_case, "fmu": fmu_case}[kind](synthetic, folder)


def changed(kind: str, content: bytes, seed: int) -> bytes:
    """Return a mutation.

    Of every second FMU one of its members is changed, which no CRC of the archive shows; of every second text the
    new bytes are some of its own, so that it stays a text.
    """
    if seed % 2 or kind not in ("fmu", "dbc", "asc", "log", "trc", "csv"):
        return mutated(content, seed)
    if kind != "fmu":
        drawn, text = random.Random(seed), bytearray(content)
        for _ in range(drawn.randint(1, 8)):
            text[drawn.randrange(len(text))] = content[drawn.randrange(len(content))]
        return bytes(text)
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(made, "w") as new:
        names = [name for name in old.namelist() if not name.startswith(("binaries", "sources", "documentation"))]
        chosen = names[seed // 2 % len(names)]
        for name in old.namelist():
            held = old.read(name)
            new.writestr(name, mutated(held, seed) if name == chosen and held else held)
    return made.getvalue()


KINDS = (*LOGS, "dbc", "hdf5", "fmu")


def problems(kind: str, seeds: range, synthetic: SyntheticFiles, folder: Path) -> list[str]:
    content, path, ends = case_of(kind, synthetic, folder)
    path.write_bytes(content)
    sound = ends(path)
    assert sound.code == 0, sound.errors
    found, longest, largest = [], 0.0, 0
    for seed in seeds:
        path.write_bytes(changed(kind, content, seed))
        ended = ends(path)
        longest, largest = max(longest, ended.duration), max(largest, ended.memory)
        if problem := ended.problem():
            found.append(f"seed {seed}: {problem}")
    print(f"{kind}: {len(seeds)} mutations, at most {longest:.1f} s and {largest / 2**20:.0f} MiB")
    return found


@pytest.mark.parametrize("seed", sweep([15, 21, 37, 51, 251, 311, 436], [15, 436]))
def test_an_mf4_file_that_ends_its_parser(seed: int, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """By a crash, a loop, a message of its own, gigabytes, or times without end; it is read in a process apart."""
    assert problems("mf4", range(seed, seed + 1), synthetic, tmp_path) == []


@pytest.mark.parametrize("kind", KINDS)
def test_a_few_mutations(kind: str, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    assert problems(kind, range(1000, 1002), synthetic, tmp_path) == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_five_hundred_mutations(kind: str, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    assert problems(kind, range(500), synthetic, tmp_path) == []
