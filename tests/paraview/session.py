"""Run scripts of this folder one after another in one ParaView: its start takes longer than most.

pvpython tests/paraview/session.py TOLD NAME=ARGUMENT,ARGUMENT ...

Of each script TOLD, a JSON file, gets what it printed, or its traceback.
"""

import contextlib
import gc
import io
import json
import runpy
import sys
import traceback
from pathlib import Path

from paraview import servermanager, simple
from vtkmodules.vtkCommonCore import vtkOutputWindow

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
# At each reset ParaView 5.11 searches all its proxies for the help text of each: two seconds.
servermanager.ProxyNamespace.getDocumentation = lambda *_: ""

reported, window = {}, vtkOutputWindow.GetInstance()
file, *words = sys.argv[1:]
for word in words:
    name, _, arguments = word.partition("=")
    sys.argv = [name, *filter(None, arguments.split(","))]
    out, streams = io.StringIO(), (sys.__stdout__, sys.stdout, sys.stderr)
    try:
        with contextlib.redirect_stdout(out):
            sys.__stdout__ = out
            runpy.run_path(str(HERE / f"{name}.py"), run_name="__main__")
        reported[name] = out.getvalue()
    except BaseException:
        reported[name] = traceback.format_exc()
    finally:
        sys.__stdout__, sys.stdout, sys.stderr = streams
        vtkOutputWindow.SetInstance(window)
    simple.ResetSession()
    gc.collect()
Path(file).write_text(json.dumps(reported))
