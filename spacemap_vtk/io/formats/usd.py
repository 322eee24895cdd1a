"""Write Universal Scene Description (.usdc, .usda): a mesh with animated blend shapes.

UsdSkel's blend shapes correspond to glTF's morph targets. They need a skeleton; here it has one
joint that does not move. Pixar's library can write only to a disk, and hardly reports that it is
full. It therefore writes into the system's temporary folder, and the file is copied from there.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.io.output import write_parts
from spacemap_vtk.io.provenance import NAME, finds_record, record_text
from spacemap_vtk.io.registry import SMALLER_FILE_CURE, require_package, writes

if TYPE_CHECKING:
    from spacemap_vtk.datasets.moving_surface import MovingSurface, YarnCurves

#: Roughness of yarn, as in glTF.
_ROUGHNESS = 0.75
#: Bytes of a layer per point.
_POINT = 110
#: Bytes of a layer per point of each target (place and normal).
_TARGET_POINT = 24
_require = require_package(
    "usd-core", "pxr", "Run: pip install 'spacemap_vtk[usd]', or write a .glb."
)


@writes(
    ".usdc",
    ".usda",
    label="Universal Scene Description",
    holds=("moving", "modes"),
    require=_require,
)
def write_usd(file: Path, moving: MovingSurface) -> None:
    """Write a surface with its targets and their animations."""
    from pxr import Sdf, Tf, Usd

    from spacemap_vtk.memory import require_memory
    from spacemap_vtk.temporary_files import temporary_folder

    require_memory(
        (_POINT + _TARGET_POINT * len(moving.targets)) * len(moving.points),
        "a layer of {1} points in {0} shapes".format(*moving.targets.shape),
        cure=SMALLER_FILE_CURE,
    )
    layer = Sdf.Layer.CreateAnonymous(file.suffix)
    _fill_stage(Usd.Stage.Open(layer), moving)
    with temporary_folder() as folder:
        made = folder / f"made{file.suffix}"
        try:
            done = layer.Export(str(made))
        except Tf.ErrorException as error:
            raise SpacemapError(
                f"{file.name}: usd-core could not write the file: {error}"
            ) from None
        if not done:
            raise SpacemapError(f"{file.name}: usd-core could not write the file in {folder}")
        del layer  # frees the memory of the whole file
        with made.open("rb") as stream:
            write_parts(file, iter(partial(stream.read, 2**24), b""))


def _vector_array(values: Any) -> Any:
    import numpy as np
    from pxr import Vt

    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))


def _fill_stage(stage: Any, moving: MovingSurface) -> None:
    import numpy as np
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdSkel, Vt

    from spacemap_vtk.datasets.moving_surface import to_linear_light

    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z if moving.is_z_up else UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    root = UsdSkel.Root.Define(stage, "/Cloth")
    root.GetPrim().SetDisplayName(moving.title)
    stage.SetDefaultPrim(root.GetPrim())
    stage.GetRootLayer().customLayerData = {
        key: value for key, value in moving.metadata.items() if not isinstance(value, list)
    } | ({NAME: record_text()} if record_text() else {})
    mesh = UsdGeom.Mesh.Define(stage, "/Cloth/Surface")
    mesh.CreatePointsAttr(_vector_array(moving.points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(moving.triangles), 3))
    corners = np.ascontiguousarray(moving.triangles.reshape(-1), np.int32)
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(corners))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(True)
    # The extent contains every place that the targets can reach: a mesh whose extent is out of
    # sight is not drawn.
    reach = sum(map(np.abs, moving.targets), 0.0)
    ends = (moving.points - reach).min(axis=0), (moving.points + reach).max(axis=0)
    mesh.CreateExtentAttr(_vector_array(np.array(ends)))
    if moving.normals is not None:
        mesh.CreateNormalsAttr(_vector_array(moving.normals))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    if moving.has_point_colors:
        shown = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
            "displayColor", Sdf.ValueTypeNames.Color3fArray, UsdGeom.Tokens.vertex
        )
        shown.Set(_vector_array(to_linear_light(moving.colors)))
    for number, material in enumerate(moving.materials):
        place = f"/Cloth/Looks/Material_{number}"
        prim = UsdShade.Material.Define(stage, place)
        prim.GetPrim().SetDisplayName(material.name)
        shader = UsdShade.Shader.Define(stage, f"{place}/Surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        color = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
        color.Set(Gf.Vec3f(*material.color))
        if moving.has_point_colors:
            reader = UsdShade.Shader.Define(stage, f"{place}/Colors")
            reader.CreateIdAttr("UsdPrimvarReader_float3")
            reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
            read = reader.CreateOutput("result", Sdf.ValueTypeNames.Float3)
            color.ConnectToSource(read)
        shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(_ROUGHNESS)
        made = shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
        prim.CreateSurfaceOutput().ConnectToSource(made)
        faces = np.flatnonzero(material.points[moving.triangles[:, 0]]).astype(np.int32)
        binding = UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim())
        part = binding.CreateMaterialBindSubset(f"Part_{number}", Vt.IntArray.FromNumpy(faces))
        UsdShade.MaterialBindingAPI.Apply(part.GetPrim()).Bind(prim)
    # One frame for each time, if the times are equally spaced.
    seconds = moving.clips[0].times if moving.clips else np.zeros(1)
    rate = (len(seconds) - 1) / float(seconds[-1]) if len(seconds) > 1 else 24.0
    if moving.curves is not None:
        _add_curves(stage, moving.curves, rate * seconds)
    if not len(moving.targets):
        return
    names = [f"shape_{number}" for number in range(len(moving.targets))]
    skeleton = UsdSkel.Skeleton.Define(stage, "/Cloth/Skeleton")
    still = Vt.Matrix4dArray(1, Gf.Matrix4d(1.0))
    skeleton.CreateJointsAttr(["root"])
    skeleton.CreateBindTransformsAttr(still)
    skeleton.CreateRestTransformsAttr(still)
    bound = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    bound.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    bound.CreateBlendShapesAttr(names)
    paths = []
    for number, name in enumerate(names):
        shape = UsdSkel.BlendShape.Define(stage, f"/Cloth/Surface/{name}")
        shape.GetPrim().SetDisplayName(moving.target_names[number])
        shape.CreateOffsetsAttr(_vector_array(moving.targets[number]))
        if moving.normal_targets is not None:
            shape.CreateNormalOffsetsAttr(_vector_array(moving.normal_targets[number]))
        paths.append(shape.GetPath())
    bound.CreateBlendShapeTargetsRel().SetTargets(paths)
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(rate)
    stage.SetStartTimeCode(0.0)
    stage.SetEndTimeCode(rate * max(float(clip.times[-1]) for clip in moving.clips))
    source = UsdSkel.BindingAPI.Apply(skeleton.GetPrim())
    choice = root.GetPrim().GetVariantSets().AddVariantSet("motion")
    for number, clip in enumerate(moving.clips):
        animation = UsdSkel.Animation.Define(stage, f"/Cloth/Motion_{number}")
        animation.GetPrim().SetDisplayName(clip.name)
        animation.CreateBlendShapesAttr(names)
        weights = animation.CreateBlendShapeWeightsAttr()
        for second, row in zip(clip.times, clip.weights, strict=True):
            code = Usd.TimeCode(rate * float(second))
            weights.Set(Vt.FloatArray.FromNumpy(np.ascontiguousarray(row, np.float32)), code)
        # Each animation is a variant that can be selected.
        choice.AddVariant(f"motion_{number}")
        choice.SetVariantSelection(f"motion_{number}")
        with choice.GetVariantEditContext():
            source.CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    choice.SetVariantSelection("motion_0")


def _add_curves(stage: Any, curves: YarnCurves, codes: Any) -> None:
    """Add yarns, plies or fibres as curves, and a variant that selects curves or surface."""
    import numpy as np
    from pxr import Usd, UsdGeom, Vt

    from spacemap_vtk.datasets.moving_surface import to_linear_light

    made = UsdGeom.BasisCurves.Define(stage, "/Cloth/Yarns")
    made.CreateTypeAttr(UsdGeom.Tokens.cubic)
    made.CreateBasisAttr(curves.basis)
    counts = np.ascontiguousarray(curves.counts, np.int32)
    made.CreateCurveVertexCountsAttr(Vt.IntArray.FromNumpy(counts))
    widths = np.ascontiguousarray(curves.widths, np.float32)
    made.CreateWidthsAttr(Vt.FloatArray.FromNumpy(widths))
    made.SetWidthsInterpolation(UsdGeom.Tokens.uniform)
    made.CreateDisplayColorPrimvar(UsdGeom.Tokens.uniform).Set(
        _vector_array(to_linear_light(curves.colors))
    )
    points, extent = made.CreatePointsAttr(), made.CreateExtentAttr()
    half = widths.max() / 2
    for number, places in enumerate(curves.points):
        code = Usd.TimeCode(float(codes[number])) if len(codes) > 1 else Usd.TimeCode.Default()
        points.Set(_vector_array(places), code)
        ends = places.min(axis=0) - half, places.max(axis=0) + half
        extent.Set(_vector_array(np.array(ends)), code)
    choice = stage.GetDefaultPrim().GetVariantSets().AddVariantSet("yarns")
    for name, hidden in (("curves", "/Cloth/Surface"), ("surface", "/Cloth/Yarns")):
        choice.AddVariant(name)
        choice.SetVariantSelection(name)
        with choice.GetVariantEditContext():
            UsdGeom.Imageable(stage.GetPrimAtPath(hidden)).MakeInvisible()


@finds_record(".usdc", ".usda")
def find_record_in_usd(path: Path) -> str | None:
    """Find the record in the layer's metadata."""
    _require(path)
    from pxr import Sdf, Tf

    try:
        layer = Sdf.Layer.OpenAsAnonymous(str(path), metadataOnly=True)
    except Tf.ErrorException:
        return None
    found = layer.customLayerData.get(NAME) if layer else None
    return found if isinstance(found, str) else None
