"""What the fuzzers start from and once found: all of it ends in results or in one line."""

from pathlib import Path

import pytest
from fuzz_targets import TARGETS, authentication_from, database_from, frames_from
from hypothesis import given, settings
from hypothesis import strategies as st

pytestmark = pytest.mark.fast

CORPUS = Path(__file__).with_name("corpus")


@pytest.mark.parametrize("path", sorted(CORPUS.glob("*/*")), ids=lambda path: f"{path.parent.name}-{path.name}")
def test_corpus(path: Path) -> None:
    TARGETS[path.parent.name](path.read_bytes())


@given(data=st.binary(max_size=600))
@settings(max_examples=150, deadline=None)
def test_any_bytes_as_frames(data: bytes) -> None:
    frames_from(data)


@given(data=st.binary(max_size=400))
@settings(max_examples=60, deadline=None)
def test_any_bytes_as_attacks(data: bytes) -> None:
    authentication_from(data)


@given(data=st.data())
@settings(max_examples=50, deadline=None)
def test_altered_databases(data: st.DataObject) -> None:
    seeds = [path.read_bytes() for path in sorted((CORPUS / "database").iterdir())]
    content = bytearray(data.draw(st.sampled_from(seeds)))
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(32, 126))
    database_from(bytes(content))
