"""ParaView's pictures: yarns in their own colours, and no picture of a batch without a display.

ParaView's *Map Scalars* follows the array that is coloured by: with it ticked, as it is by default,
ParaView 5.11 sends colours through a colour map like any other numbers. What else it has does not
do: a colour map in VTK's vector mode RGBCOLORS does not know that mode's name, and ends ParaView at
the next choice of an array.

ParaView shows a legend for every array that it colours by. One of colours that go through no colour
map would tell the sizes of red, green and blue taken as a vector: it stays hidden.

Without a display ParaView 5.11 itself ends with a print of its stack. Of several processes the
first may wait for ever: it wants what the others have drawn, which take no part in the picture
since they have found that there is no display.

Of colours that go through no colour map ParaView 5.11 assumes that they may be translucent. To draw
what is translucent, each of several processes must have what lies in a box of its own, so that all
data are cut by planes and sent about before every picture: 60 x 60 yarns took 37 s of each
processor for that, where drawing them takes 8. The yarns' colours are opaque, which ParaView's
actors can be told, though by no property: each process is asked to tell its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import methodcaller
from typing import Any, ClassVar

from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import VTK_UNSIGNED_CHAR, vtkWeakReference

_NAME = 4  # place of the array's name in the property ColorArrayName
#: The proxies that are observed.
_followed: set[int] = set()
#: Of which representations all processes know whether they are opaque.
_told: dict[int, bool] = {}


def show_colors() -> None:
    """From now on set *Map Scalars* of each new representation, whenever its array changes."""
    # It is unticked for three components of unsigned char named ``color``, as `WeaveSource` has
    # them, and ticked for others. What a user ticks by hand stays until the next choice of an
    # array.
    observers = {"representations": _follow, "scalar_bars": _follow_legend}
    _at_each_proxy(("PROCESS_CLIENT", "PROCESS_BATCH"), observers)


def _at_each_proxy(
    processes: Sequence[str], observers: Mapping[str, Callable[[Any], object]]
) -> None:
    """In processes of some types, observe each new proxy of some groups."""
    try:
        from paraview.modules.vtkRemotingCore import vtkProcessModule
        from paraview.modules.vtkRemotingServerManager import vtkSMProxyManager
    except ImportError:  # a server built without a client's libraries
        return

    def registered_one(manager: Any, _event: str) -> None:
        session = manager.GetActiveSessionProxyManager()
        for group, observe in observers.items() if session is not None else ():
            for proxy in registered(session, group):
                if proxy.GetGlobalID() not in _followed:
                    _followed.add(proxy.GetGlobalID())
                    observe(proxy)

    types = [getattr(vtkProcessModule, name) for name in processes]
    if vtkProcessModule.GetProcessType() in types:
        vtkSMProxyManager.GetProxyManager().AddObserver("RegisterEvent", registered_one)


def registered(session: Any, group: str) -> Iterator[Any]:
    """Yield the proxies of a group."""
    from paraview.modules.vtkRemotingServerManager import vtkSMProxyIterator

    iterator = vtkSMProxyIterator()
    iterator.SetSessionProxyManager(session)
    iterator.SetModeToOneGroup()
    iterator.Begin(group)
    while not iterator.IsAtEnd():
        yield iterator.GetProxy()
        iterator.Next()


def _weak(proxy: Any) -> Callable[[], Any]:
    """Return what returns a proxy as long as it lives."""
    # Python's collector takes an observer that refers to what it observes for garbage.
    kept = vtkWeakReference()
    kept.Set(proxy)
    return kept.Get


def _follow(proxy: Any) -> None:
    array, mapped = proxy.GetProperty("ColorArrayName"), proxy.GetProperty("MapScalars")
    if array is None or mapped is None or not hasattr(array, "GetElement"):
        return
    alive = _weak(proxy)

    def adjust(caller: Any, event: str) -> None:
        name, representation = caller.GetElement(_NAME), alive()
        if name and representation is not None:
            wanted = int(not (name == "color" and _has_colors(representation)))
            if mapped.GetElement(0) != wanted:
                mapped.SetElement(0, wanted)  # handed on together with the array's name

    def tell(caller: Any, event: str) -> None:
        if (representation := alive()) is not None:
            _tell_opaque(representation)

    array.AddObserver("ModifiedEvent", adjust)
    adjust(array, "")
    for changed in (array, mapped, proxy.GetProperty("Opacity")):
        changed.AddObserver("ModifiedEvent", tell)
    tell(mapped, "")


def _tell_opaque(proxy: Any) -> None:
    """Tell all processes whether nothing shines through a representation."""
    hides = (
        not proxy.GetProperty("MapScalars").GetElement(0)
        and proxy.GetProperty("Opacity").GetElement(0) >= 1.0
        and _has_colors(proxy)
    )
    number, session = proxy.GetGlobalID(), proxy.GetSessionProxyManager()
    if _told.get(number, False) == hides:
        return
    _told[number] = hides
    # To the actor of a client itself, and through a proxy of our own to those of its server.
    _force(number, hides)
    if (teller := session.NewProxy("sources", OPAQUE)) is not None:
        for place, value in enumerate((number, int(hides))):
            teller.GetProperty("Opaque").SetElement(place, value)
        teller.UpdateVTKObjects()


def _follow_legend(proxy: Any) -> None:
    alive = _weak(proxy)

    def hide(caller: Any, event: str) -> None:
        legend = alive()
        if legend is not None and caller.GetElement(0) and not _maps(legend):
            caller.SetElement(0, 0)

    shown = proxy.GetProperty("Visibility")
    shown.AddObserver("ModifiedEvent", hide)
    hide(shown, "")


def _maps(legend: Any) -> bool:
    """Whether anything goes through a legend's colour map, as far as it is known."""
    table = _table(legend)
    mapped = [
        bool(proxy.GetProperty("MapScalars").GetElement(0))
        for proxy in registered(legend.GetSessionProxyManager(), "representations")
        if proxy.GetProperty("MapScalars") is not None and _table(proxy) == table
    ]
    return table is None or any(mapped) or not mapped


def _table(proxy: Any) -> int | None:
    """Return the number of the colour map that a legend or representation has."""
    own = proxy.GetProperty("LookupTable")
    table = own.GetProxy(0) if own is not None and own.GetNumberOfProxies() else None
    return None if table is None else int(table.GetGlobalID())


def _has_colors(representation: Any) -> bool:
    shown = representation.GetProperty("Input")
    source = shown.GetProxy(0)
    if source is None:
        return False
    data = source.GetDataInformation(shown.GetOutputPortForConnection(0))
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


def guard_pictures() -> None:
    """From now on no view of a batch begins to draw unless all its processes can."""
    observe = methodcaller("AddObserver", "StartEvent", _require_display)
    _at_each_proxy(("PROCESS_BATCH",), {"views": observe})


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


#: A proxy of our own that tells actors.
OPAQUE = "SpacemapOpaque"


class SpacemapOpaque(VTKPythonAlgorithmBase):
    """Tells actors in each process of a server; it makes no data, and stands in no menu."""

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
        """Tell the actor of a representation, by the number that all processes know it by."""
        _force(number, bool(opaque))


#: The actors of this process that are told to be opaque, by the number of their representation.
_forced: dict[int, vtkWeakReference] = {}


def _force(number: int, opaque: bool) -> None:
    """Let a representation's surface be opaque whatever its colours are, or not."""
    # Where no script runs nothing has imported the classes of what the session holds; and one
    # process alone that took its surface for opaque would wait for the others for ever.
    from paraview.modules import vtkRemotingViews  # noqa: F401
    from paraview.modules.vtkRemotingCore import vtkProcessModule
    from vtkmodules import vtkRenderingCore  # noqa: F401

    if not opaque:
        # the one that was told: another way to show it may have been chosen since
        actor = _forced.pop(number).Get() if number in _forced else None
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
        _forced[number] = vtkWeakReference()
        _forced[number].Set(actor)
