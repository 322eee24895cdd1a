"""Run one job in a separate process, which can be ended at any moment.

``python -m spacemap_vtk.jobs.worker`` reads a request as JSON from its standard input, see
`make_request`. It prints a line of JSON for each message: ``{"done": 3, "of": 50}`` for progress,
``{"lost": ...}`` for what the file cannot store, and finally ``{"result": ...}``, or
``{"error": ...}`` if it fails.
The process that has started it makes the output appear, or removes it.
"""

from __future__ import annotations

import json
import os
import sys
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from spacemap_vtk.errors import SpacemapError, SpacemapWarning
from spacemap_vtk.io.output import explain_disk_errors
from spacemap_vtk.jobs.job import Job, job_from_json
from spacemap_vtk.temporary_files import raise_on_signals

#: Added to the process's niceness, so that the window stays responsive.
_NICENESS = 5
#: Kinds of jobs that need only the draft, which is valid even if its yarns do not fit.
_WITHOUT_GEOMETRY = ("draft", "plan")
#: Attributes of an error that are sent to the other process.
_ERROR_PARTS = ("message", "section", "key", "value", "allowed", "cure")


def make_request(job: Job, values: Mapping[str, Any], base: Path) -> str:
    """Return a job, the values of its scene and the scene's folder as the request for a worker."""
    request = {"job": job.as_json(), "output": str(job.output), "values": values, "base": str(base)}
    return json.dumps(request, default=str)


def error_from_json(parts: Mapping[str, Any]) -> SpacemapError:
    """Return the error that a worker has sent."""
    error = SpacemapError(**{name: part for name, part in parts.items() if name != "section"})
    error.section = parts.get("section")
    return error


def main() -> None:
    """Run the job that standard input describes."""
    warnings.simplefilter("ignore", SpacemapWarning)  # the window shows the warnings of stages
    if hasattr(os, "nice"):
        os.nice(_NICENESS)
    try:
        from spacemap_vtk.scenes.scene import Scene

        request = json.loads(sys.stdin.read())
        job = job_from_json(request["job"], Path(request["output"]))
        scene = Scene(request["values"], Path(request["base"]))
        # Errors name the output file only, because the user does not know the hidden folder.
        with raise_on_signals(), explain_disk_errors(job.output, job.output.name):
            if job.kind not in _WITHOUT_GEOMETRY:
                scene.check()
            result = job.run(
                scene,
                lambda done, of: _send({"done": done, "of": of}),
                lambda text: _send({"lost": text}),
                atomic=False,
            )
            _send({"result": result})
    except Exception as error:
        parts = {}
        if isinstance(error, SpacemapError):
            parts = {name: getattr(error, name, None) for name in _ERROR_PARTS}
        _send({"error": {**parts, "message": parts.get("message") or str(error)}})
        sys.exit(1)


def _send(message: dict[str, Any]) -> None:
    # The value in an error may be of any type.
    print(json.dumps(message, default=str), flush=True)


if __name__ == "__main__":
    main()
