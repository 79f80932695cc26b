"""`d4cad morph`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from d4cad.cli import pictures
from d4cad.cli.options import Grammar, Json, Method, Quiet, Seed, Variant
from d4cad.cli.running import INTERRUPTED, progress, reported
from d4cad.errors import D4cadError

if TYPE_CHECKING:
    from d4cad.fit import Fit


def morph(
    images: Annotated[
        list[Path],
        typer.Argument(metavar="IMAGE...", help="Two pictures of one size or more, in order.", show_default=False),
    ],
    out: Annotated[
        Path,
        typer.Option("-o", "--out", metavar="DIR", help="Folder for all that is written.", show_default=False),
    ],
    grammar: Grammar = "arc-line",
    variant: Variant = None,
    method: Method = "fast",
    seed: Seed = 0,
    max_time: Annotated[
        float | None, typer.Option(metavar="S", help="Seconds for each picture.", show_default=False)
    ] = None,
    threshold: pictures.Threshold = None,
    invert: Annotated[bool, typer.Option("--invert", help="Exchange shape and ground.")] = False,
    still: Annotated[bool, typer.Option("--no-frames", help="Write no frame-0001.png, ...")] = False,
    force: Annotated[bool, typer.Option("--force", help="Write to a folder that is not empty.")] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Continue one program through changing pictures: morph.gif, strip.svg, a program file for each, and all frames.

    The first picture is fitted; every further one goes on from the program of the one before.
    """
    with reported():
        from d4cad.animation import Film, picture, thinned, write_gif
        from d4cad.exporters.strip import write_strip
        from d4cad.files import replacing
        from d4cad.morphing import morph as fits

        _check_folder(out, force=force)
        film, found = Film(), list[Any]()
        with progress(None, shown=not (quiet or as_json)) as watch:
            for fit in fits(
                images,
                grammar=grammar,
                variant=variant,
                method=method,
                seed=seed,
                max_time=max_time,
                threshold=threshold,
                invert=invert,
                watch=watch,
                film=film,
            ):
                found.append(fit)
        out.mkdir(parents=True, exist_ok=True)
        for old in out.glob("frame-[0-9][0-9][0-9][0-9].png"):
            old.unlink()
        write_gif(out / "morph.gif", film.frames)
        captions = [f"{Path(str(f.settings['picture'])).stem}: {f.psnr:.1f} dB, {f.primitives}" for f in found]
        write_strip(
            [(caption, fit.outline) for caption, fit in zip(captions, found, strict=True)],
            found[0].canvas,
            out / "strip.svg",
        )
        for k, (fit, image) in enumerate(zip(found, images, strict=False), 1):
            fit.save(out / f"{k:02}-{image.stem}.json")
        frames = [] if still else thinned(film.frames)
        for k, frame in enumerate(frames, 1):
            with replacing(out / f"frame-{k:04}.png") as temporary:
                picture(frame).save(temporary)
        if as_json:
            rows = [_facts(fit) for fit in found]
            typer.echo(json.dumps({"pictures": rows, "frames": len(film.frames), "out": str(out)}, allow_nan=False))
        elif not quiet:
            typer.echo(_table(found))
            typer.echo(f"wrote morph.gif, strip.svg, {len(found)} program files and {len(frames)} frames to {out}")
        if found[-1].stop.name == "INTERRUPTED":
            raise typer.Exit(INTERRUPTED)


def _check_folder(out: Path, *, force: bool) -> None:
    """Refuses, before anything is computed, a folder that cannot be written to; leaves nothing behind."""
    from d4cad.files import check_writable

    if out.exists() and not out.is_dir():
        raise D4cadError(f"expected a folder to write to, but {out} is a file")
    if not force and out.is_dir() and any(out.iterdir()):
        raise D4cadError(f"the folder {out} is not empty: name another one, or add --force")
    there = next(folder for folder in (out, *out.absolute().parents) if folder.exists())
    check_writable(there / "morph.gif")


def _facts(fit: Fit) -> dict[str, Any]:
    return {
        "picture": fit.settings["picture"],
        "psnr": fit.psnr,
        "primitives": fit.primitives,
        "start_psnr": fit.start_psnr,
        "seconds": fit.seconds,
        "stop": fit.stop.name.lower(),
    }


def _table(fits: list[Fit]) -> str:
    names = [str(fit.settings["picture"]) for fit in fits]
    width = max(len(name) for name in names)
    lines = [f"{'picture'.ljust(width)}     start       end  {fits[0].counted or 'primitive'}s      CPU"]
    for name, fit in zip(names, fits, strict=True):
        count = str(fit.primitives).rjust(len(fits[0].counted or "primitive") + 1)
        lines.append(
            f"{name.ljust(width)}  {fit.start_psnr:5.1f} dB  {fit.psnr:5.1f} dB  {count}  {fit.seconds:5.1f} s"
        )
    return "\n".join(lines)
