"""Colours that hide what is behind them: several processes need not hand their data round.

Of colours that go through no colour map ParaView 5.11 assumes that they may be translucent. To draw
what is translucent, each of several processes must have what lies in a box of its own, so that all
data are cut by planes and sent about before every picture: 60 x 60 yarns took 37 s of each
processor for that, where drawing them takes 8. The yarns' colours are opaque, which ParaView's
actors can be told, though by no property: each process is asked to tell its own.
"""

from __future__ import annotations

from typing import ClassVar

from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import vtkWeakReference

NAME = "SpacemapOpaque"


class SpacemapOpaque(VTKPythonAlgorithmBase):
    """Tells actors in each process of a server; it makes no data, and stands in no menu."""

    _pvsm_proxy_xml: ClassVar[str] = f"""
<ServerManagerConfiguration>
  <ProxyGroup name="sources">
    <SourceProxy name="{NAME}" class="{__name__}.{NAME}" si_class="vtkSIPythonSourceProxy">
      <IntVectorProperty name="Opaque" command="set_opaque" number_of_elements="2"
        default_values="0 0" panel_visibility="never"/>
    </SourceProxy>
  </ProxyGroup>
</ServerManagerConfiguration>"""

    def __init__(self) -> None:
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkPolyData")

    def set_opaque(self, number: int, opaque: int) -> None:
        """Tell the actor of a representation, by the number that all processes know it by."""
        force(number, bool(opaque))


#: The actors of this process that are told to be opaque, by the number of their representation.
_forced: dict[int, vtkWeakReference] = {}


def force(number: int, opaque: bool) -> None:
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
