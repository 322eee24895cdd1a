"""Make ParaView draw yarns in their own colours, and draw nothing in a batch without a display.

- *Map Scalars* is set according to the array that colours a representation. By default it is
  ticked, and ParaView 5.11 then sends colours through a colour map like any other numbers. ParaView
  has no other solution: a colour map in VTK's vector mode RGBCOLORS does not know the name of this
  mode, and ends ParaView when the next array is chosen.
- ParaView shows a legend for every array by which it colours. For colours without a colour map it
  would show the magnitudes of (red, green, blue) as vectors, so it stays hidden.
- Without a display, ParaView 5.11 alone ends with a printed stack. With several processes, the
  first may wait for ever for what the others have drawn. They take no part in the picture, because
  they have found that there is no display.
- ParaView 5.11 assumes that colours without a colour map may be translucent. To draw translucent
  data, each of several processes needs the data inside one box. All data are therefore cut by
  planes and redistributed before every picture: for 60 x 60 yarns this took 37 s of each processor,
  and drawing them takes 8 s. The yarns' colours are opaque. ParaView has no property for this, but
  its actors can be set to opaque, and each process is asked to set its actors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import methodcaller
from typing import Any, ClassVar

from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import VTK_UNSIGNED_CHAR, vtkWeakReference

_NAME = 4  # index of the array's name in the property ColorArrayName
#: Global ids of the proxies that are observed.
_observed: set[int] = set()
#: Whether a representation is opaque, by its global id, as all processes know it.
_opaque_by_id: dict[int, bool] = {}


def show_colors() -> None:
    """Set *Map Scalars* of each new representation, and again whenever its array changes."""
    # It is unticked for three components of unsigned char named ``color``, which `WeaveSource` has,
    # and ticked for all other arrays. A user's choice stays until another array is chosen.
    observers = {"representations": _follow_representation, "scalar_bars": _follow_legend}
    _observe_proxies(("PROCESS_CLIENT", "PROCESS_BATCH"), observers)


def _observe_proxies(
    processes: Sequence[str], observers: Mapping[str, Callable[[Any], object]]
) -> None:
    """Observe each new proxy of some groups, in processes of some types."""
    try:
        from paraview.modules.vtkRemotingCore import vtkProcessModule
        from paraview.modules.vtkRemotingServerManager import vtkSMProxyManager
    except ImportError:  # a server built without a client's libraries
        return

    def on_register(manager: Any, _event: str) -> None:
        session = manager.GetActiveSessionProxyManager()
        for group, observe in observers.items() if session is not None else ():
            for proxy in registered_proxies(session, group):
                if proxy.GetGlobalID() not in _observed:
                    _observed.add(proxy.GetGlobalID())
                    observe(proxy)

    types = [getattr(vtkProcessModule, name) for name in processes]
    if vtkProcessModule.GetProcessType() in types:
        vtkSMProxyManager.GetProxyManager().AddObserver("RegisterEvent", on_register)


def registered_proxies(session: Any, group: str) -> Iterator[Any]:
    """Yield the proxies of a group."""
    from paraview.modules.vtkRemotingServerManager import vtkSMProxyIterator

    iterator = vtkSMProxyIterator()
    iterator.SetSessionProxyManager(session)
    iterator.SetModeToOneGroup()
    iterator.Begin(group)
    while not iterator.IsAtEnd():
        yield iterator.GetProxy()
        iterator.Next()


def _weak_reference(proxy: Any) -> Callable[[], Any]:
    """Return a function that returns a proxy while it exists."""
    # Python's collector would delete an observer that refers to the object that it observes.
    kept = vtkWeakReference()
    kept.Set(proxy)
    return kept.Get


def _follow_representation(proxy: Any) -> None:
    array, mapped = proxy.GetProperty("ColorArrayName"), proxy.GetProperty("MapScalars")
    if array is None or mapped is None or not hasattr(array, "GetElement"):
        return
    alive = _weak_reference(proxy)

    def adjust(caller: Any, event: str) -> None:
        name, representation = caller.GetElement(_NAME), alive()
        if name and representation is not None:
            has_colors = _has_colors(representation)
            if name == "color" and has_colors is None:
                return  # a state file is being loaded, which contains the user's choice
            wanted = int(not (name == "color" and has_colors))
            if mapped.GetElement(0) != wanted:
                mapped.SetElement(0, wanted)  # sent together with the array's name

    def send(caller: Any, event: str) -> None:
        if (representation := alive()) is not None:
            _send_opacity(representation)

    array.AddObserver("ModifiedEvent", adjust)
    adjust(array, "")
    for changed in (array, mapped, proxy.GetProperty("Opacity")):
        changed.AddObserver("ModifiedEvent", send)
    send(mapped, "")


def _send_opacity(proxy: Any) -> None:
    """Inform all processes whether a representation is opaque."""
    hides = (
        not proxy.GetProperty("MapScalars").GetElement(0)
        and proxy.GetProperty("Opacity").GetElement(0) >= 1.0
        and bool(_has_colors(proxy))
    )
    number, session = proxy.GetGlobalID(), proxy.GetSessionProxyManager()
    if _opaque_by_id.get(number, False) == hides:
        return
    _opaque_by_id[number] = hides
    # The client sets its actor directly, and those of its server through a proxy of this plugin.
    _set_actor_opaque(number, hides)
    if (setter := session.NewProxy("sources", OPAQUE)) is not None:
        for place, value in enumerate((number, int(hides))):
            setter.GetProperty("Opaque").SetElement(place, value)
        setter.UpdateVTKObjects()


def _follow_legend(proxy: Any) -> None:
    alive = _weak_reference(proxy)

    def hide(caller: Any, event: str) -> None:
        legend = alive()
        if legend is not None and caller.GetElement(0) and not _uses_color_map(legend):
            caller.SetElement(0, 0)

    shown = proxy.GetProperty("Visibility")
    shown.AddObserver("ModifiedEvent", hide)
    hide(shown, "")


def _uses_color_map(legend: Any) -> bool:
    """Return whether anything uses a legend's colour map; True if this is not known."""
    table = _color_map_id(legend)
    mapped = [
        bool(proxy.GetProperty("MapScalars").GetElement(0))
        for proxy in registered_proxies(legend.GetSessionProxyManager(), "representations")
        if proxy.GetProperty("MapScalars") is not None and _color_map_id(proxy) == table
    ]
    return table is None or any(mapped) or not mapped


def _color_map_id(proxy: Any) -> int | None:
    """Return the global id of the colour map of a legend or representation."""
    own = proxy.GetProperty("LookupTable")
    table = own.GetProxy(0) if own is not None and own.GetNumberOfProxies() else None
    return None if table is None else int(table.GetGlobalID())


def _has_colors(representation: Any) -> bool | None:
    """Return whether what is shown has colours; None if it was not computed yet."""
    shown = representation.GetProperty("Input")
    source = shown.GetProxy(0)
    if source is None:
        return False
    data = source.GetDataInformation(shown.GetOutputPortForConnection(0))
    if data.GetNumberOfPoints() == 0:
        return None
    found = (
        arrays.GetArrayInformation("color")
        for arrays in (data.GetCellDataInformation(), data.GetPointDataInformation())
    )
    return any(
        array is not None
        and array.GetDataType() == VTK_UNSIGNED_CHAR
        and array.GetNumberOfComponents() == 3
        for array in found
    )


def require_batch_display() -> None:
    """Prevent the views of a batch from drawing unless all of its processes can."""
    observe = methodcaller("AddObserver", "StartEvent", _require_display)
    _observe_proxies(("PROCESS_BATCH",), {"views": observe})


def _require_display(view: Any, event: str) -> None:
    from paraview.modules.vtkRemotingCore import vtkPVSession
    from paraview.modules.vtkRemotingViews import vtkPVRenderingCapabilitiesInformation

    # what all processes support
    found = vtkPVRenderingCapabilitiesInformation()
    view.GetSession().GatherInformation(vtkPVSession.RENDER_SERVER, found, 0)
    if not found.Supports(vtkPVRenderingCapabilitiesInformation.RENDERING):
        # Python ends with this exception in an observer too; mpirun then ends the other processes.
        raise SystemExit(
            "spacemap: ParaView has no display. Set DISPLAY for each of its processes, start it "
            'with "xvfb-run -a", or use a ParaView built with EGL or OSMesa.'
        )


#: Name of the proxy that sets actors to opaque.
OPAQUE = "SpacemapOpaque"


class SpacemapOpaque(VTKPythonAlgorithmBase):
    """Source that sets actors to opaque in each process; it makes no data and is in no menu."""

    _pvsm_proxy_xml: ClassVar[str] = f"""
<ServerManagerConfiguration>
  <ProxyGroup name="sources">
    <SourceProxy name="{OPAQUE}" class="{__name__}.{OPAQUE}" si_class="vtkSIPythonSourceProxy">
      <IntVectorProperty name="Opaque" command="set_opaque" number_of_elements="2"
        default_values="0 0" panel_visibility="never"/>
    </SourceProxy>
  </ProxyGroup>
</ServerManagerConfiguration>"""

    def __init__(self) -> None:
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkPolyData")

    def set_opaque(self, number: int, opaque: int) -> None:
        """Set whether a representation's actor is opaque; `number` is the global id."""
        _set_actor_opaque(number, bool(opaque))


#: Actors of this process that were set to opaque, by the global id of their representation.
_opaque_actors: dict[int, vtkWeakReference] = {}


def _set_actor_opaque(number: int, opaque: bool) -> None:
    """Make a representation's surface opaque whatever its colours are, or undo this."""
    # These imports define the classes of the session's objects; where no script runs, nothing else
    # imports them. If only one process took its surface for opaque, it would wait for the others
    # for ever.
    from paraview.modules import vtkRemotingViews  # noqa: F401
    from paraview.modules.vtkRemotingCore import vtkProcessModule
    from vtkmodules import vtkRenderingCore  # noqa: F401

    if not opaque:
        # Undo it for the same actor: another kind of representation may have been chosen since.
        actor = _opaque_actors.pop(number).Get() if number in _opaque_actors else None
        if actor is not None:
            actor.ForceOpaqueOff()
        return
    session = vtkProcessModule.GetProcessModule().GetSession()
    here = session and session.GetSessionCore().GetSIObject(number)
    composite = here.GetVTKObject() if here else None
    shown = getattr(composite, "GetActiveRepresentation", lambda: None)()
    actor = getattr(shown, "GetActor", lambda: None)()
    if actor is not None:
        actor.ForceOpaqueOn()
        _opaque_actors[number] = vtkWeakReference()
        _opaque_actors[number].Set(actor)
