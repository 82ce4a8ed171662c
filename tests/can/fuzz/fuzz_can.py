"""Coverage-guided fuzzing with atheris, which is not among the project's requirements: pip install atheris.

From the root of the repository, in an environment that holds the project, ten minutes in all:

    python tests/can/fuzz/fuzz_can.py all -max_total_time=200

One target of ``frames``, ``database`` (DBC file and mapping) and ``authentication``, with inputs that are kept:

    python tests/can/fuzz/fuzz_can.py frames NEW tests/can/fuzz/corpus/frames -max_total_time=600

New inputs go into the first folder: give an empty one ahead of the corpus to keep that small.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "support")]


def main() -> None:
    """Run the target that the first argument names, or all of them one after the other."""
    import atheris

    with atheris.instrument_imports(include=["strainfmu", "cantools"]):
        import fuzz_targets
    name = sys.argv.pop(1)
    if name == "all":
        for target in fuzz_targets.TARGETS:
            with tempfile.TemporaryDirectory(prefix="strainfmu_") as new:
                folders = [new, str(HERE / "corpus" / target)]
                subprocess.run([sys.executable, __file__, target, *folders, *sys.argv[1:]], check=True)
        return
    atheris.Setup(sys.argv, fuzz_targets.TARGETS[name])
    atheris.Fuzz()


if __name__ == "__main__":
    main()
