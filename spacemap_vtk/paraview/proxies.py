"""Server-manager XML of a stage: how ParaView shows it, in which menu, with which properties."""

from __future__ import annotations

import inspect
from collections import Counter
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement, tostring

from spacemap_vtk.filters.base import Stage
from spacemap_vtk.io.registry import reader_endings, readers
from spacemap_vtk.parameters import Parameter
from spacemap_vtk.paraview.property_xml import add_hint, property_name, property_of

CATEGORY = "Space mapping"
#: Least number of parameters with the same first word that form a group.
_SMALLEST_GROUP = 3
#: ParaView's icons, by the role of a stage in a scene.
_ICONS = {
    "cage": "pqUnstructuredGrid16.png",
    "solver": "pqSinusoidal24.png",
    "mover": "pqVcrPlay.svg",
    "rotation": "pqRotateCameraCW.svg",
    "crimp": "pqLineChart16.png",
    "warp": "pqWarp.svg",
    "surface": "pqPolydata16.png",
}


class FileParameter(NamedTuple):
    """The file parameter of a source, which makes it a reader."""

    parameter: str
    """Name of the parameter that is the file."""
    holds: str
    """A key of `spacemap_vtk.io.registry.READ`."""


def proxy_xml(stage: type[Stage], label: str, path: str, file: FileParameter | None = None) -> str:
    """Return the XML that describes a stage to ParaView."""
    root = Element("ServerManagerConfiguration")
    group = SubElement(root, "ProxyGroup", name="filters" if stage.inputs else "sources")
    proxy = SubElement(
        group,
        "SourceProxy",
        {"name": label.replace(" ", ""), "label": label, "class": path},
        si_class="vtkSIPythonSourceProxy",
    )
    text = inspect.cleandoc(stage.__doc__ or label).split("\n\nParameters\n")[0]
    summary = " ".join(text.split("\n\n")[0].split())
    documentation = SubElement(proxy, "Documentation", short_help=summary, long_help=summary)
    documentation.text = " ".join(text.split())
    for port, (name, kind) in enumerate(zip(stage.input_names, stage.inputs, strict=False)):
        _add_input(proxy, port, name, kind)
    names = {name: property_name(p) for name, p in stage.parameters.items()}
    if file is not None:
        names[file.parameter] = "FileName"  # ParaView finds the property of the file by this name
    for name, parameter in stage.parameters.items():
        xml = property_of(parameter).xml
        if names[name] == "FileName":
            xml.set("name", "FileName")
            xml.set("label", "File Name")
        for key, values in parameter.when.items():
            _add_visibility(
                xml, names[key], [property_of(stage.parameters[key]).write(v) for v in values]
            )
        proxy.append(xml)
    if stage.time_range is not Stage.time_range:
        _add_time_properties(proxy)
    for heading, members in property_groups(stage.parameters).items():
        box = SubElement(proxy, "PropertyGroup", label=heading)
        for parameter in members:
            SubElement(box, "Property", name=names[parameter.name])
    hints = SubElement(proxy, "Hints")
    icon = _ICONS.get(stage.role, "pqSource16.png")
    SubElement(hints, "ShowInMenu", category=CATEGORY, icon=f":/pqWidgets/Icons/{icon}")
    if file is not None:
        SubElement(
            hints,
            "ReaderFactory",
            extensions=" ".join(ending[1:] for ending in reader_endings(file.holds)),
            file_description=readers(file.holds)[0].label,
        )
    return tostring(root, encoding="unicode")


def property_groups(parameters: dict[str, Parameter]) -> dict[str, list[Parameter]]:
    """Return the parameters that are shown in groups, by the heading of the group."""
    firsts = Counter(name.split("_")[0] for name, p in parameters.items() if not p.group)
    made: dict[str, list[Parameter]] = {}
    for name, parameter in parameters.items():
        first, *rest = name.split("_")
        heading = parameter.group
        if not heading and rest and firsts[first] >= _SMALLEST_GROUP:
            heading = first.capitalize()
        if heading:
            made.setdefault(heading, []).append(parameter)
    return made


def _add_input(proxy: Element, port: int, name: str, kind: str) -> None:
    xml = SubElement(
        proxy, "InputProperty", name=name, command="SetInputConnection", port_index=str(port)
    )
    allowed = SubElement(xml, "ProxyGroupDomain", name="groups")
    SubElement(allowed, "Group", name="sources")
    SubElement(allowed, "Group", name="filters")
    types = SubElement(xml, "DataTypeDomain", name="input_type", composite_data_supported="1")
    SubElement(types, "DataType", value=kind)


def _add_visibility(xml: Element, key: str, values: list[Any]) -> None:
    """Show a property only if another has one of these values; without values, if it has any."""
    shown = add_hint(xml, "PropertyWidgetDecorator")
    shown.attrib |= {"type": "GenericDecorator", "mode": "visibility", "property": key}
    if len(values) < 2:
        shown.attrib |= {"value": str(*values), "inverse": str(int(not values))}
    else:
        shown.set("values", " ".join(map(str, values)))


def _add_time_properties(proxy: Element) -> None:
    """Give ParaView's clock the times that the stage reports."""
    for name, helper in (
        ("TimestepValues", "TimeStepsInformationHelper"),
        ("TimeRange", "TimeRangeInformationHelper"),
    ):
        xml = SubElement(proxy, "DoubleVectorProperty", name=name, information_only="1")
        if name == "TimestepValues":
            xml.set("repeatable", "1")
        SubElement(xml, helper)
