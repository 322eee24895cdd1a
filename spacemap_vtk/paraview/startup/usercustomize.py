"""Python runs this at its start when the folder is on PYTHONPATH, as `spacemap paraview` puts it.

ParaView up to 5.11 asks for `inspect.getargspec`, which left Python in 3.11; without it no Python
plugin loads. ParaView imports it before any plugin has a chance to act.
"""

import inspect

if not hasattr(inspect, "getargspec"):
    inspect.getargspec = inspect.getfullargspec  # type: ignore[attr-defined]
