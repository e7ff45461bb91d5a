"""``frametwin prepare``: afterwards a process finds machine code for what a fit calls."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from cli_tools import done

from frametwin.errors import Cancelled
from frametwin.service.prepare import prepare

LOOK = """
import numpy as np
import frametwin
from frametwin.fitting.api import fit_views
from frametwin.raster import rod_kernels, silhouette
from frametwin.service.prepare import prepare

prepare()
kernels = [rod_kernels.render, rod_kernels.gather_struts, rod_kernels.gather_joints, rod_kernels.gather_opacity]
kernels.append(rod_kernels.compare)
before = [kernel.signatures.copy() for kernel in (*kernels, silhouette._fill)]  # none where the code was kept
made = frametwin.simulate("bridge", views=4, size=(90, 120))
fit_views(made.frame, made.cameras, [image / np.float32(255.0) for image in made.images])
print(all(len(own) <= 1 for own in before), before == [kernel.signatures for kernel in (*kernels, silhouette._fill)])
"""


def test_a_fit_after_it_compiles_nothing() -> None:
    """What a fit calls its loops with is what they were prepared for."""
    run = subprocess.run([sys.executable, "-c", LOOK], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["True", "True"]


WITHOUT = """
import sys
import numpy as np
from frametwin.cameras.rigs import ring_rig
from frametwin.fitting.api import fit_views
from frametwin.geometry.parametric import half_bowl

frame = half_bowl(5, 1)
fit_views(frame, ring_rig(frame, 2, size=(24, 32)), [np.zeros((24, 32), dtype=np.float32)] * 2)
print("numba" in sys.modules, "scipy" in sys.modules)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="machine code is kept on Linux alone")
def test_a_fit_after_it_loads_neither_the_compiler_nor_scipy() -> None:
    """Which would take it longer to start than some batches take to fit."""
    prepare()
    run = subprocess.run([sys.executable, "-c", WITHOUT], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False", "False"]


def test_the_command_names_what_it_compiles() -> None:
    told = json.loads(done("prepare", "--quiet", "--json").stdout)["compiled"]
    assert len(told) == 8 and all(each["seconds"] >= 0.0 for each in told)
    stages: list[str] = []
    with pytest.raises(Cancelled):
        prepare(lambda progress: stages.append(progress.stage) or len(stages) < 2)
    assert stages == ["compiling silhouettes", "compiling pictures of rods"]
