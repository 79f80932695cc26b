"""Run in an environment that holds the wheel and no extras: import, fit a tiny picture, say what is missing."""

import json
import subprocess
import sys
from importlib.metadata import distribution
from importlib.util import find_spec
from pathlib import Path

import numpy as np

import d4cad

assert Path(d4cad.__file__).is_relative_to(sys.prefix), d4cad.__file__
packed = {str(file) for file in distribution("d4cad").files or ()}
assert {"d4cad/py.typed", "d4cad/grammars/arc_line/__init__.py", "d4cad/exporters/__init__.py"} <= packed
assert not {file for file in packed if file.startswith(("grammars", "exporters", "tests"))}
assert not find_spec("torch")
assert not find_spec("OCP")

y, x = np.mgrid[:64, :64] + 0.5
picture = np.clip(20.5 - np.hypot(x - 32, y - 30), 0, 1)

fit = d4cad.fit_image(picture)
assert fit.psnr > 30, fit.psnr
fit.save("disc.json")
fit.save("disc.svg")
again = d4cad.fit_image(picture, init="disc.json")
assert again.psnr > 30, again.psnr

help_text = subprocess.run(["d4cad", "--help"], capture_output=True, text=True, check=True).stdout
assert "fit" in help_text

from PIL import Image  # noqa: E402  (a core dependency, but d4cad imports it late)

Image.fromarray(np.rint(picture * 255).astype(np.uint8)).save("disc.png")
done = subprocess.run(
    ["d4cad", "fit", "disc.png", "-o", "cli.json", "--json"], capture_output=True, text=True, check=True
)
assert json.loads(done.stdout)["psnr"] > 30
assert Path("cli.json").is_file()

refused = subprocess.run(["d4cad", "fit", "disc.png", "-o", "disc.step"], capture_output=True, text=True, check=False)
assert refused.returncode == 2, refused
assert "pip install" in refused.stderr, refused.stderr
assert not Path("disc.step").exists()

print(f"wheel of d4cad {d4cad.__version__}: fitted {fit.primitives} primitives at {fit.psnr:.0f} dB")
