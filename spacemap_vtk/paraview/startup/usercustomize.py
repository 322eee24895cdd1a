"""Restore `inspect.getargspec`, without which ParaView up to 5.11 loads no Python plugin.

Python runs this file at its start if the folder is on PYTHONPATH, as `spacemap paraview` sets it.
Python 3.11 has removed `inspect.getargspec`, and ParaView imports it before a plugin can act.
"""

import inspect

if not hasattr(inspect, "getargspec"):
    inspect.getargspec = inspect.getfullargspec  # type: ignore[attr-defined]
