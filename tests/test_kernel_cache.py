"""The cache of compiled kernels never outlives the sources that it was made from."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from d4cad.raster import drop_stale_kernels


@pytest.mark.parametrize(("own", "used", "kept"), [(10, 10, True), (30, 10, False), (10, 30, False)])
def test_kernels_older_than_a_source_they_use_are_dropped(tmp_path: Path, own: int, used: int, kept: bool) -> None:
    room, uses = tmp_path / "room", tmp_path / "uses"
    (room / "__pycache__").mkdir(parents=True)
    uses.mkdir()
    for path, time in ((room / "a.py", own), (uses / "b.py", used), (room / "__pycache__" / "a.f-1.nbi", 20)):
        path.write_text("")
        os.utime(path, (time, time))
    drop_stale_kernels(room, uses)
    assert (room / "__pycache__" / "a.f-1.nbi").exists() == kept
