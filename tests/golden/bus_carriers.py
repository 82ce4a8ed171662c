"""The bridge and the closed loop as carriers of streams: frames of a bus in, and FMUs that feed each other."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
from estimator_carrier import in_part
from fmu_carriers import Places, columns, fields_of
from inputs import Inputs, Results
from other_carriers import without_masks

from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Protection
from strainfmu.can.frame_layout import FLOAT, FlowSignal, FrameLayout, InputFrame, InputLayout, SignalLayout
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings
from strainfmu.can.profiles import shared_signal
from strainfmu.cosim.estimators.source import open_step
from strainfmu.cosim.estimators.step import other_inputs
from strainfmu.cosim.systems.master import matching_connections, simulate
from strainfmu.cosim.systems.system import Connection, System
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.fmu.python.package import imports_put_back
from strainfmu.interface.fmi_variables import COEFFICIENTS

CYCLE = 0.02
"""Time between two samples [s], whatever the stream states: no carrier here filters."""

_NUMBERS = count(1)

PER_FRAME = 7
"""Numbers of 64 bits in a frame, behind its head."""

OWN_CHECKS_OFF = BridgeSettings(
    stuck_cycles=0,
    zero_jump=1e9,
    rate_limit=1e9,
    heal_cycles=1,
    **dict.fromkeys(("pressure_max_age", "navigation_max_age", "sensor_max_age"), 0.5),
)
"""The bridge holds no value and refuses no gauge that the sender vouches for: streams jump, as no vehicle does."""

FLOW = ("dynamic_pressure", "mach_number", "altitude")


def by_bridge(source: Path, inverse_map: InverseMap, inputs: Inputs) -> Results:
    """Return what a bridge makes of frames, in virtual time; NaN of a cycle without an estimate, which is INVALID.

    The first three cycles of a bus are not trusted yet: the first sample is sent as many times more.
    """
    inputs = _first_again(without_masks(inputs), 3)
    given, n = columns(inverse_map, inputs), inverse_map.n_strain_gauges
    with open_step(source) as ready:
        others = [name for name in other_inputs(ready.step) if name in given]
        layout = _layout(n, ("dynamic_pressure", *others))
        core, encoder = Machine(layout, ready.step, OWN_CHECKS_OFF, start=0.0), StrainEncoder(layout)
        found = list[Result]()
        for k, strain in enumerate(inputs.strain[:, :n]):
            values = {name: float(given[name][k]) for name in ("dynamic_pressure", *others)}
            flow = {name: values.pop(name) for name in FLOW if name in values}
            for frame in encoder.encode(strain, cycle=k, sample_time=CYCLE * k, readings=values, **flow):
                found += core.receive(frame.with_data(frame.data, CYCLE * k))
        assert core.account.unaccounted == 0
    assert len(found) == len(inputs)
    assert all(one.health is None for one in found[:3])
    del found[:3]
    own = ("coefficients", "coefficients_std", "chi_square")
    results = {name: np.array([getattr(one, name) for one in found]) for name in own}
    results["health"] = np.array([HealthState.INVALID if one.health is None else one.health for one in found])
    names = found[-1].other_outputs.keys()
    outputs = {name: np.array([one.other_outputs.get(name, np.nan) for one in found]) for name in names}
    # A cycle without any strain is not given to the estimator.
    results["chi_square"] = np.nan_to_num(results["chi_square"])
    if "health.envelope_score" in outputs:
        outputs["health.envelope_score"] = np.nan_to_num(outputs["health.envelope_score"])
    return in_part(results) | fields_of(Places(inverse_map, arrays=False), outputs)


def _first_again(inputs: Inputs, times: int = 1) -> Inputs:
    """Return inputs whose first sample comes so many times more."""
    return inputs.rows(np.append(np.zeros(times, dtype=int), np.arange(len(inputs))))


def _layout(n_gauges: int, quantities: Sequence[str]) -> InputLayout:
    """Return frames of numbers of 64 bits, which lose no digit: flow first, as the encoder sends it."""
    flow = [quantities[k : k + PER_FRAME] for k in range(0, len(quantities), PER_FRAME)]
    gauges = [range(k, min(k + PER_FRAME, n_gauges)) for k in range(0, n_gauges, PER_FRAME)]
    of_flow = [
        replace(
            _frame(f"Flow{number}", 0x100 + number, len(names)),
            flow=tuple(FlowSignal(quantity=name, index=4 + k) for k, name in enumerate(names)),
        )
        for number, names in enumerate(flow)
    ]
    of_strain = [
        replace(
            _frame(f"Strain{number}", 0x200 + number, len(own)),
            indices=tuple(range(4, 4 + len(own))),
            gauges=tuple(own),
            to_strain=(1.0,) * len(own),
        )
        for number, own in enumerate(gauges)
    ]
    return InputLayout(
        name="golden",
        n_gauges=n_gauges,
        strain_frames=tuple(of_strain),
        flow_frames=tuple(of_flow),
        cycle_time=CYCLE,
    )


HEADER = {"crc_5": 0, "counter_5": 16, "status": 24, "sample_time": 32}
"""Signals ahead of the numbers of a frame, with their first bits."""


def _frame(name: str, identifier: int, n: int) -> InputFrame:
    numbers = [SignalLayout(name=f"N{k}", start=64 + 64 * k, length=64, kind=FLOAT) for k in range(n)]
    layout = FrameLayout(
        name=name,
        identifier=identifier,
        length=64,
        signals=(
            *(shared_signal(field, bit) for field, bit in HEADER.items()),
            *numbers,
        ),
        is_fd=True,
        protection=Protection(5, identifier),
        cycle_time=CYCLE,
    )
    return InputFrame(layout=layout, sample_time=3, status=2)


PLAYER = '''"""Plays a stream: sample k at the communication point k; gives back what it was fed."""

from functools import partial
from pathlib import Path

import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Integer, Real
from strainfmu.fmu.python.wrapper_exit import let_go_at_exit


class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        let_go_at_exit(Path(self.resources), self.modelName)
        with np.load(Path(self.resources) / "stream.npz") as content:
            names, self.values = content["names"].tolist(), content["values"]
        self.k, self.fed = 0, np.full({n_fed}, np.nan)
        for i, name in enumerate(names):
            played = self._whole if name == "q_source" else self._played
            self._add(name, Fmi2Causality.output, partial(played, i))
        for i in range({n_fed}):
            self._add(f"fed[{{i + 1}}]", Fmi2Causality.input, partial(self._was_fed, i), partial(self._feed, i))
            self._add(f"was_fed[{{i + 1}}]", Fmi2Causality.output, partial(self._was_fed, i))

    def _add(self, name, causality, getter, setter=None):
        kind = Integer if name == "q_source" else Real
        self.register_variable(kind(name, causality=causality, getter=getter, setter=setter), nested=False)

    def _played(self, i):
        return self.values[self.k, i]

    def _whole(self, i):
        return int(np.nan_to_num(self.values[self.k, i]))

    def _was_fed(self, i):
        return self.fed[i]

    def _feed(self, i, value):
        self.fed[i] = value

    def do_step(self, current_time, step_size):
        self.k += 1
        return True
'''


def by_loop(source: Path, inverse_map: InverseMap, inputs: Inputs) -> Results:
    """Return what the master gives of the FMU at ``source`` behind one that plays the stream.

    The coefficients go back to that with a delay, and are taken from it. Of initialization an FMU keeps nothing:
    the first sample is played twice.
    """
    inputs = _first_again(without_masks(inputs))
    given = columns(inverse_map, inputs)
    places = Places(inverse_map, arrays=False)
    instances = {
        "player": _player(source.parent, {name: given[name] for name in places.inputs if name in given}),
        "estimator": source,
    }
    back = [
        Connection(f"estimator.{name}", f"player.fed[{i + 1}]", delayed=True)
        for i, name in enumerate(COEFFICIENTS)
    ]
    system = System(instances, (*matching_connections("player", "estimator", instances), *back))
    found = simulate(system, CYCLE * (len(inputs) - 1), CYCLE)
    results = {name: found[f"estimator.{name}"] for name in places.outputs}
    for i, name in enumerate(COEFFICIENTS):
        np.testing.assert_array_equal(found[f"player.was_fed[{i + 1}]"][1:], results[name][:-1])
    return fields_of(places, {name: values[1:] for name, values in results.items()})


def _player(folder: Path, played: Mapping[str, np.ndarray]) -> Path:
    """Return an FMU that plays columns (k,) by name; Python keeps its module, so each has a name of its own."""
    name = f"Player{next(_NUMBERS)}"
    np.savez(folder / "stream.npz", names=[*played], values=np.column_stack([*played.values()]))
    script = folder / f"{name.lower()}_slave.py"
    script.write_text(PLAYER.format(name=name, n_fed=len(COEFFICIENTS)))
    with imports_put_back():
        from pythonfmu import FmuBuilder

        return Path(
            FmuBuilder.build_FMU(script, dest=folder / f"{name}.fmu", project_files=[folder / "stream.npz"])
        )
