"""Coverage-guided fuzzing with atheris, which is not among the project's requirements: pip install atheris.

From the root of the repository, in an environment that holds the project:

    python tests/can/fuzz/fuzz_can.py frames tests/can/fuzz/corpus/frames -max_total_time=600
    python tests/can/fuzz/fuzz_can.py database tests/can/fuzz/corpus/database -max_total_time=600
    python tests/can/fuzz/fuzz_can.py authentication tests/can/fuzz/corpus/authentication -max_total_time=600

New inputs go into the first folder: give an empty one ahead of the corpus to keep that small.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2] / "support")]


def main() -> None:
    """Run the target that the first argument names."""
    import atheris

    with atheris.instrument_imports(include=["strainfmu", "cantools"]):
        import fuzz_targets
    target = fuzz_targets.TARGETS[sys.argv.pop(1)]
    atheris.Setup(sys.argv, target)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
