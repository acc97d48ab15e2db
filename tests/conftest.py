"""Fixtures that several files share."""

import os
from pathlib import Path

import pytest

ASSETS = Path(os.environ.get("FRAMEPAIRS_ASSETS", Path(__file__).parents[2] / "shared" / "assets"))


@pytest.fixture(scope="session")
def assets() -> Path:
    if not ASSETS.is_dir():
        pytest.skip(f"third-party assets are not at {ASSETS} (set FRAMEPAIRS_ASSETS)")
    return ASSETS


@pytest.fixture(scope="session")
def two_quads_corpus(tmp_path_factory):
    """A rendered corpus: a textured wall, and a quad that slides before it; 3 moving frames, a cut, 16 still ones."""
    from sample_corpus import render_two_quads

    return render_two_quads(tmp_path_factory.mktemp("corpus") / "two_quads")
