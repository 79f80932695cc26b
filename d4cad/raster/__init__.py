"""Compiled kernels and the raster that every grammar makes."""

from contextlib import suppress
from pathlib import Path

HERE = Path(__file__).parent


def drop_stale_kernels(room: Path, *uses: Path) -> None:
    """Delete compiled kernels of a folder that are older than its sources or than those of the folders it ``uses``.

    Numba's cache notices a change of a kernel's own file, but not of another file whose functions the kernel inlines:
    after a pull, a checkout would go on running the old ones.
    """
    newest = max(source.stat().st_mtime for folder in (room, *uses) for source in folder.glob("*.py"))
    for index in room.glob("__pycache__/*.nbi"):
        with suppress(OSError):  # another process was faster, or the folder is not ours to write
            if index.stat().st_mtime < newest:
                index.unlink()


drop_stale_kernels(HERE)
