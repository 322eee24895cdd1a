"""Every declared parameter is a property: same order, same default, with help; in one menu."""

import re

from paraview import servermanager, simple

from spacemap_vtk.filters.base import Stage
from spacemap_vtk.paraview.property_xml import property_name
from spacemap_vtk.paraview.stages import PROXIES


def check(name: str, stage: type[Stage]) -> None:
    proxy = getattr(simple, name)()
    declared = [property_name(p) for p in stage.parameters.values()]
    order, help = [], {}
    iterator = proxy.SMProxy.NewPropertyIterator()
    iterator.Begin()
    while not iterator.IsAtEnd():
        order.append(iterator.GetKey())
        documentation = iterator.GetProperty().GetDocumentation()
        help[iterator.GetKey()] = documentation.GetDescription() if documentation else ""
        iterator.Next()
    assert sorted(set(declared) - set(order)) in ([], ["Draft"], ["File"]), (declared, order)
    for parameter in stage.parameters.values():
        text = help.get(property_name(parameter), help.get("FileName"))
        assert text, (name, parameter.name)
        assert text.startswith(parameter.help), (text, parameter.help)
    # ParaView has set every property by now: what arrived is the declared default.
    proxy.UpdateVTKObjects()
    settings = proxy.GetClientSideObject().settings
    for parameter in stage.parameters.values():
        value = settings[parameter.name]
        assert value == parameter.default, (name, parameter.name, value, parameter.default)
    xml = stage._pvsm_proxy_xml
    assert 'category="Space mapping"' in xml
    # The panel's order is that of the XML, and is that of the declarations.
    commands = re.findall(r'command="set_(\w+)"', xml)
    assert commands == list(stage.parameters), commands


for name, stage in PROXIES.items():
    check(name, stage)

weave = simple.WeaveSource()
for name, label in (("WarpDiameter", "Warp Diameter"), ("Ends", "Ends")):
    assert weave.GetProperty(name).SMProperty.GetXMLLabel() == label
hints = weave.GetProperty("FibreDensity").SMProperty.GetHints()
label = hints.FindNestedElementByName("ShowComponentLabels").GetNestedElement(0)
assert label.GetAttribute("label") == "kg/m³"
hints = weave.GetProperty("WarpSpacing").SMProperty.GetHints()
shown = hints.FindNestedElementByName("PlaceholderText").GetCharacterData()
assert shown.startswith("auto (from the sett"), shown
modal = servermanager.ProxyManager().NewProxy("filters", "ModalSolver")
domain = modal.GetProperty("PoissonsRatio").FindDomain("vtkSMDoubleRangeDomain")
assert (domain.GetMinimum(0), domain.GetMaximum(0)) == (-1.0, 0.5)
words = servermanager.ProxyManager().NewProxy("filters", "BarycentricWarp")
words = words.GetProperty("Outside").FindDomain("vtkSMStringListDomain")
words = [words.GetString(i) for i in range(words.GetNumberOfStrings())]
assert words == ["extrapolate", "clamp", "error"], words
print(len(PROXIES), "proxies")
