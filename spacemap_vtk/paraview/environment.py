"""Find the plugin, and define the environment in which ParaView finds it."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from spacemap_vtk.errors import MissingLibraryError, SpacemapError

_HERE = Path(__file__).resolve().parent
PLUGIN = _HERE / "plugin.py"


def variables() -> dict[str, str]:
    """Return the environment variables with which ParaView loads the plugin at its start."""
    return {
        "PYTHONPATH": str(_HERE / "startup"),
        "PV_PLUGIN_CONFIG_FILE": str(_HERE / "plugins.xml"),
    }


def process_environment() -> dict[str, str]:
    """Return this process's environment with the variables that make ParaView load the plugin."""
    return {**os.environ, **variables()}


def check() -> str:
    """Load the plugin in the installed ParaView and run its pipeline there."""
    pvpython = shutil.which("pvpython")
    if pvpython is None:
        raise MissingLibraryError(
            "pvpython is not on the PATH",
            cure='On Debian or Ubuntu: "apt-get install paraview python3-paraview"; '
            "elsewhere, add the folder bin of ParaView to PATH.",
        )
    done = subprocess.run(
        [pvpython, str(_HERE / "check.py")],
        env=process_environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0 or done.stderr:
        reason = done.stderr or done.stdout or f"it ended with exit code {done.returncode}"
        raise SpacemapError(f"{pvpython} cannot use {PLUGIN}: {reason}")
    return done.stdout.strip()
