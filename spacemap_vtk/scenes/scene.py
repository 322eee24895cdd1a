"""A scene: the pipeline as a scene file describes it, and how to look at it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from vtkmodules.vtkCommonDataModel import (
    vtkImageData,
    vtkPointSet,
    vtkPolyData,
    vtkUnstructuredGrid,
)

from spacemap_vtk import extensions
from spacemap_vtk.datasets.processes import Piece
from spacemap_vtk.errors import GeometryError, InputError, SizeError, SpacemapError, naming_section
from spacemap_vtk.filters.barycentric_warp import BarycentricWarp
from spacemap_vtk.filters.base import Provided, Stage
from spacemap_vtk.filters.modal_response import ModalResponse
from spacemap_vtk.filters.modal_solver import ModalSolver
from spacemap_vtk.filters.motion_reader import MotionReader
from spacemap_vtk.filters.object_source import ObjectSource
from spacemap_vtk.filters.patch_tessellator import PatchTessellator
from spacemap_vtk.filters.tetra_cage import TetraCage
from spacemap_vtk.filters.textile import Textile, Woven
from spacemap_vtk.parameters import Parameterised
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.assignments import parsed, part_of, value_of
from spacemap_vtk.scenes.chain import chain, connect_chain, refuse_replaced, sections
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.settings import Animation, View
from spacemap_vtk.textile.drafts.draft import Draft

P = TypeVar("P", bound=Parameterised)


class Scene:
    """A pipeline, connected, with its view and animation.

    The object is a fabric, or with a section ``[object]`` any mesh. With a section ``[motion]`` the
    cage and its motion come from a file, and none of the stages that compute them is connected.
    Without any of the sections ``[cage]``, ``[modal]``, ``[response]`` and ``[warp]`` the fabric
    is still, and none of those stages is connected.

    Parameters
    ----------
    values : mapping
        ``title`` and a table for each section, as a scene file has them.
    file : Path, optional
        Where they come from; relative paths count from its folder, and messages name it.

    Raises
    ------
    InputError
        If a section or key does not exist, or a value is refused.

    Examples
    --------
    >>> from spacemap_vtk.scenes.scene import Scene
    >>> scene = Scene({"weave": {"ends": 3, "picks": 3}, "response": {}})
    >>> scene.update(time=0.1)
    >>> scene.surface.executions
    1
    """

    def __init__(self, values: Mapping[str, Any], file: Path | None = None) -> None:
        self.file = file
        #: What each section of the file configures, in the order of the pipeline.
        self.parts: dict[str, Parameterised] = {
            name: cls(**cls.usual(of_object=ObjectSource.section in values))
            for name, cls in sections().items()
        }
        # Those that come with the program, connected or not.
        self.object = self.part(ObjectSource)
        self.cage, self.modal = self.part(TetraCage), self.part(ModalSolver)
        self.response, self.motion = self.part(ModalResponse), self.part(MotionReader)
        self.warp, self.surface = self.part(BarycentricWarp), self.part(PatchTessellator)
        self.view, self.animation = self.part(View), self.part(Animation)
        self.title = file.stem if file else ""
        self._warnings: dict[str, None] = {}
        #: Sections and keys that `assign` has changed: the file does not say these.
        self.assigned: set[tuple[str | None, str | None]] = set()
        #: The sections that it has; `assign` adds more.
        self._sections = set(values)
        #: The stages that are connected, from source to surface.
        self.stages: list[Stage] = []
        with self.naming_file():
            refuse_replaced(self.parts, self._sections)
            for name, value in values.items():
                if name == "title":
                    self.title = _title(value)
                else:
                    self._write_section(name, value)
        self._connect()

    @classmethod
    def read(cls, scene: str | Path) -> Scene:
        """Read a scene file or a draft.

        Parameters
        ----------
        scene : str or Path
            A ``.toml`` scene, a ``.wif`` draft, a mesh such as ``model.ply``, or the name of a
            scene that comes with the program.

        Returns
        -------
        Scene
            Connected, not yet run.

        Raises
        ------
        InputError
            If the file is missing, is no TOML, or holds what a scene does not know.
        """
        path = library.find(scene)
        return cls(library.values_of(path, path.name), path)

    def part(self, cls: type[P]) -> P:
        """Return what the section of a class configures.

        Parameters
        ----------
        cls : type
            With a section, as `spacemap_vtk.WeaveSource`.

        Returns
        -------
        Parameterised
            This scene's own, connected or not.
        """
        part = self.parts[cls.section]
        assert isinstance(part, cls)
        return part

    def stage(self, role: str) -> Stage | None:
        """Return the connected stage of a role.

        Parameters
        ----------
        role : str
            One of `spacemap_vtk.filters.base.ROLES`, or another that a stage declares.

        Returns
        -------
        Stage or None
            None where the scene has none.
        """
        return next((stage for stage in self.stages if stage.role == role), None)

    @property
    def given(self) -> tuple[str, ...]:
        """The sections that it has."""
        return tuple(sorted(self._sections))

    @property
    def source(self) -> Stage:
        """What is deformed."""
        return self.stages[0]

    @property
    def textile(self) -> Textile | None:
        """The source as a textile; None where it makes no yarns."""
        return self.source if isinstance(self.source, Textile) else None

    @property
    def woven(self) -> Woven | None:
        """The source as a textile of warp and weft; None where it is anything else."""
        return self.source if isinstance(self.source, Woven) else None

    @property
    def draft_file(self) -> Path | None:
        """The file of the draft that it weaves; None where there is none."""
        return None if self.textile is None else self.textile.draft_file

    @property
    def has_draft(self) -> bool:
        """Whether a loom makes its source."""
        if self.woven is not None:
            return True  # also where the draft cannot be read: `draft` says why
        return self.textile is not None and self.textile.make_draft() is not None

    @property
    def moves(self) -> bool:
        """Whether there is a cage that moves."""
        return self.stage("mover") is not None

    @property
    def moving(self) -> list[Stage]:
        """The stages from what moves the cage to what lets the object ride along."""
        mover = self.stage("mover")
        return [] if mover is None else self.stages[self.stages.index(mover) : -1]

    @property
    def object_at_rest(self) -> Stage:
        """The stage that makes the object as it is before a cage moves it."""
        rides = (n for n, s in enumerate(self.stages) if set(s.takes) == {"object", "cage"})
        still = self.stages[: next(rides, -1)]
        return next(stage for stage in reversed(still) if stage.makes == "object")

    @property
    def last_object(self) -> Stage:
        """The stage that the surface is made of: the object, moved if the scene moves."""
        return next(stage for stage in reversed(self.stages[:-1]) if stage.makes == "object")

    @property
    def arrays(self) -> dict[str, Provided]:
        """The arrays that the connected stages add, by name."""
        return {name: array for stage in self.stages for name, array in stage.arrays.items()}

    @property
    def warnings(self) -> list[str]:
        """What the stages have said of their trustworthiness in any update, each sentence once."""
        return list(self._warnings)

    def set(self, assignment: str) -> None:
        """Change a value as ``--set`` does.

        Parameters
        ----------
        assignment : str
            ``section.key=value``, the value written as in a scene file; quotes can be left out.

        Raises
        ------
        InputError
            If it is not of that form, or refused.
        """
        section, key, text = parsed(assignment)
        self.assign(section, key, value_of(text))

    def assign(self, section: str, key: str, value: Any) -> None:
        """Change a value: the one way to do so. Messages about it do not name the file.

        The section's stage is connected, if it was not, as if the scene's file had that section.

        Parameters
        ----------
        section, key : str
            Its place in a scene file.
        value : object
            As a scene file has it.

        Raises
        ------
        InputError
            If it is refused.
        """
        self._write(section, key, value)
        self.assigned.add((section, key))
        part = self.parts[section]
        if isinstance(part, Stage) and part not in self.stages:
            self._sections.add(section)
        self._connect()

    @property
    def settings(self) -> dict[str, dict[str, Any]]:
        """The value of every parameter, by section and name."""
        return {name: part.settings for name, part in self.parts.items()}

    def adopt(
        self,
        settings: Mapping[str, Mapping[str, Any]],
        sections: Collection[str] | None = None,
    ) -> None:
        """Adopt the state of another scene; of what is the same in both nothing runs again.

        Parameters
        ----------
        settings : mapping
            All of its `settings`, or those that differ.
        sections : collection of str, optional
            The sections that the other scene has, its `given`; by default the same.
        """
        for section, values in settings.items():
            self.parts[section].configure(**values)
        self._sections = self._sections if sections is None else set(sections)
        self._connect()

    def update(self, time: float | None = None, piece: Piece | None = None) -> None:
        """Run what needs to be run for a time.

        Parameters
        ----------
        time : float, optional
            In s; by default the last one.
        piece : Piece, optional
            What part of the object; by default the last one, all of it at first.

        Raises
        ------
        SpacemapError
            If a stage refuses its input; the message names the scene's file.
        """
        self.update_stage(self.stages[-1], time, piece)

    def update_stage(
        self, stage: Stage, time: float | None = None, piece: Piece | None = None
    ) -> None:
        """Run the pipeline as far as one of its stages.

        Parameters
        ----------
        stage : Stage
            One of `stages`.
        time : float, optional
            In s; by default the last one.
        piece : Piece, optional
            As for `update`.

        Raises
        ------
        SpacemapError
            If a stage refuses its input; the message names the scene's file.
        """
        with self.naming_file():
            self._check_color()
            stage.update(time, piece)
        for run in self.stages:
            self._warnings |= dict.fromkeys(run.warnings)

    def check(self) -> None:
        """Check what can be checked without running anything.

        A draft is one whether or not there is room for its yarns: where a draft is the scene, what
        keeps it from being drawn is a warning.

        Raises
        ------
        SpacemapError
            If the draft cannot be read, the fabric is impossible, the cage's material is none,
            the damping contradicts itself, or the animation has no frames.
        """
        with self.naming_file():
            found = self.obstacle()
            own = self.source.section
            draft = None if any(part == own for part, _ in self.assigned) else self.draft_file
            # What is too large can be drawn: in parts, or from afar.
            impossible = isinstance(found, GeometryError)
            if found is not None and impossible and (draft is None or draft != self.file):
                raise found
            self._check_color()
            for stage in self.stages:
                with naming_section(stage.section):
                    stage.check()
            with naming_section("animation"):
                self.animation.frame_times()

    @property
    def colorings(self) -> list[str]:
        """What the surface's colours can show: keys of `COLORINGS`."""
        there = self.arrays
        return [
            name for name, color in COLORINGS.items() if not color.array or color.array in there
        ]

    def _check_color(self) -> None:
        color = COLORINGS.get(self.view.color)
        if color is not None and not color.array:
            return  # as at each frame: what arrays there are takes long to ask
        with naming_section("view"):
            if self.view.color not in self.colorings:
                raise InputError(
                    "this scene has nothing of that kind to show",
                    key="color",
                    value=self.view.color,
                    allowed=", ".join(self.colorings),
                )

    def _choose_color_array(self) -> None:
        """Let an array of the cage that the colours show ride along with the object."""
        array = COLORINGS[self.view.color].array
        of_cage = {name for stage in self.stages if stage.makes == "cage" for name in stage.arrays}
        rides = array in of_cage and array not in self.warp.arrays
        self.warp.color_array = array if rides else ""

    def obstacle(self) -> GeometryError | SizeError | None:
        """Return what keeps the cloth from being built; builds nothing.

        Returns
        -------
        GeometryError, SizeError or None
            The yarns have no room, or the patches do not fit into memory; None where neither is so,
            or the scene is not woven. What the cloth says of its own trustworthiness, and an
            obstacle, is among the warnings from now on.

        Raises
        ------
        SpacemapError
            If the draft cannot be read, or parameters contradict each other.
        """
        woven = self.woven
        if woven is None:
            return None
        found: GeometryError | SizeError
        what = "there is no room for its yarns, so that it cannot be drawn"
        with self.naming_file(), naming_section(self.source.section):
            try:
                woven.cloth.check()
                self._warnings |= dict.fromkeys(woven.cloth.warnings)
            except GeometryError as error:
                found = error
            else:
                try:
                    _ = woven.counts
                    return None
                except SizeError as error:
                    found, what = error, "it is too large to be made whole, as files have it"
        found.section = self.source.section
        parameter = self.source.parameters.get(found.key or "")
        if isinstance(found.value, float) and parameter is not None:
            found.value = parameter.show(found.value)  # with its unit, as the stage would say it
        self.warn(f"{what}: {found}")
        return found

    def warn(self, text: str) -> None:
        """Add a sentence to `warnings`, once.

        Parameters
        ----------
        text : str
            One sentence.
        """
        self._warnings[text] = None

    @property
    def patches(self) -> vtkPointSet:
        """The Bézier patches or the object, moved if the scene moves, as of the last update."""
        return self.last_object.output

    @property
    def deforming(self) -> Stage:
        """The stage from which the warp takes the cage."""
        for stage in reversed(self.stages):
            if stage.makes == "cage":
                return stage
        raise InputError(
            "this scene has no cage",
            key="cage",
            cure='Add a section [cage], or "--set cage.divisions=[5,5,1]".',
        )

    @property
    def deformed_cage(self) -> vtkUnstructuredGrid:
        """The cage with its displacement, as of the last update; its points are at rest."""
        return self.deforming.output

    @property
    def draft(self) -> Draft:
        """The draft of the textile; needs no update."""
        with self.naming_file(), naming_section(self.source.section):
            draft = None if self.textile is None else self.textile.make_draft()
            if draft is None:
                raise InputError(
                    f"{self.title}: this scene is not woven, and has no draft",
                    cure="Weaves have a section [weave], or are drafts.",
                )
            self._warnings |= dict.fromkeys(draft.warnings)
            return draft

    def data(self, kind: str) -> Any:
        """Return what is a key of `spacemap_vtk.io.registry.DATA`, as of the last update.

        Parameters
        ----------
        kind : str
            ``"patches"``, ``"surface"``, ``"cage"`` or ``"draft"``, or the name of an extension's
            data (`spacemap_vtk.extensions`), such as ``"analysis"``.

        Returns
        -------
        vtkDataSet, Draft or InputDeck
            The pipeline's own.

        Raises
        ------
        InputError
            If the scene has no cage, or no draft that can be read.
        """
        if kind in ("patches", "surface"):
            return self.patches if kind == "patches" else self.polygons
        if kind in ("cage", "draft"):
            return self.deformed_cage if kind == "cage" else self.draft
        return extensions.load("data", kind)(self)

    @property
    def painting(self) -> vtkImageData | None:
        """What the object is painted with; None where it shows its own colours."""
        return self.object.picture if self.source is self.object else None

    @property
    def polygons(self) -> vtkPolyData:
        """The surface, as of the last update."""
        return self.stages[-1].output

    def _write_section(self, section: str, values: Any) -> None:
        """Write what a file says of a section."""
        part = part_of(self.parts, section)
        if not isinstance(values, Mapping):
            raise InputError(
                "not a section",
                key=section,
                value=values,
                cure=f"Write [{section}] on its own line.",
            )
        folder = self.file.parent if self.file else Path()
        for key, value in values.items():
            with naming_section(section):
                value = part.parameter(key).within(value, folder)
            self._write(section, key, value)

    def _write(self, section: str, key: str, value: Any) -> None:
        part = part_of(self.parts, section)
        with naming_section(section):
            part.write(key, value)

    def _connect(self) -> None:
        stages = chain(self.parts, self._sections)
        if stages != self.stages:
            self.stages = stages
            connect_chain(stages)
        self._choose_color_array()

    @contextmanager
    def naming_file(self) -> Iterator[None]:
        """Name this scene's file in an error, unless `set` is to blame.

        Yields
        ------
        None
            While it is named.
        """
        try:
            yield
        except SpacemapError as error:
            assigned = (error.section, error.key) in self.assigned
            if error.file is None and self.file is not None and not assigned:
                error.file = str(self.file)
            raise


def _title(value: Any) -> str:
    """Return a scene's title without control characters."""
    if not isinstance(value, str):
        raise InputError("not a string", key="title", value=value)
    return "".join(c if c.isprintable() else " " for c in value)
