"""A batch that is about to draw where it cannot ends with a message.

Without a display ParaView 5.11 itself ends with a print of its stack. Of several processes the
first may wait for ever: to draw the yarns' own colours it wants the data of all in order of depth,
while the others, which have found that there is no display, take no part in the picture.
"""

from __future__ import annotations

from typing import Any

from spacemap_vtk.paraview.own_colors import registered

_guarded: set[int] = set()


def guard_pictures() -> None:
    """From now on no view of a batch begins to draw unless all its processes can."""
    try:
        from paraview.modules.vtkRemotingCore import vtkProcessModule
        from paraview.modules.vtkRemotingServerManager import vtkSMProxyManager
    except ImportError:  # a server built without a client's libraries
        return
    if vtkProcessModule.GetProcessType() == vtkProcessModule.PROCESS_BATCH:
        manager = vtkSMProxyManager.GetProxyManager()
        manager.AddObserver("RegisterEvent", lambda caller, event: _guard_new(caller))


def _guard_new(manager: Any) -> None:
    session = manager.GetActiveSessionProxyManager()
    if session is None:
        return
    for view in registered(session, "views"):
        if view.GetGlobalID() not in _guarded:
            _guarded.add(view.GetGlobalID())
            view.AddObserver("StartEvent", _require_display)


def _require_display(view: Any, event: str) -> None:
    from paraview.modules.vtkRemotingCore import vtkPVSession
    from paraview.modules.vtkRemotingViews import vtkPVRenderingCapabilitiesInformation

    # what all processes can
    found = vtkPVRenderingCapabilitiesInformation()
    view.GetSession().GatherInformation(vtkPVSession.RENDER_SERVER, found, 0)
    if not found.Supports(vtkPVRenderingCapabilitiesInformation.RENDERING):
        # out of an observer, too, Python ends with it; mpirun then ends the other processes
        raise SystemExit(
            "spacemap: ParaView has no display to draw on. Set DISPLAY for each of its processes, "
            'or start it under "xvfb-run -a"; one that is built with EGL or OSMesa needs neither.'
        )
