"""A scene: the pipeline that a scene file describes, with its view and animation."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
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
from spacemap_vtk.applicability import add_warning, key_of_warning
from spacemap_vtk.datasets.processes import Piece
from spacemap_vtk.errors import (
    GeometryError,
    InputError,
    SizeError,
    SpacemapError,
    add_section_to_errors,
)
from spacemap_vtk.filters.barycentric_warp import BarycentricWarp
from spacemap_vtk.filters.base import ROLES, ProvidedArray, Stage
from spacemap_vtk.filters.modal_response import ModalResponse
from spacemap_vtk.filters.modal_solver import ModalSolver
from spacemap_vtk.filters.motion_reader import MotionReader
from spacemap_vtk.filters.object_source import ObjectSource
from spacemap_vtk.filters.patch_tessellator import PatchTessellator, bake_brightness
from spacemap_vtk.filters.tetra_cage import TetraCage
from spacemap_vtk.filters.textile import Textile, Woven
from spacemap_vtk.io import registry
from spacemap_vtk.parameters import Parameterised
from spacemap_vtk.scenes import library
from spacemap_vtk.scenes.assignments import parse_value, require_part, split_assignment
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.pipeline import (
    choose_stages,
    connect_stages,
    find_replaced,
    refuse_replaced,
    section_classes,
)
from spacemap_vtk.scenes.settings import Animation, View
from spacemap_vtk.scenes.stage_memory import require_stages
from spacemap_vtk.textile.drafts.draft import Draft
from spacemap_vtk.textile.geometry.irregularity import Irregularity

P = TypeVar("P", bound=Parameterised)


class Scene:
    """A connected pipeline with its view and animation.

    The object is a fabric, or with a section ``[object]`` any mesh. With a section ``[motion]`` the
    cage and its motion come from a file, and the stages that compute them are not connected.
    Without any of the sections ``[cage]``, ``[modal]``, ``[response]`` and ``[warp]`` the fabric
    does not move, and those stages are not connected.

    Parameters
    ----------
    values : mapping
        ``title`` and a table for each section, as in a scene file.
    file : Path, optional
        File of the values; relative paths start from its folder, and messages name it.

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
        #: The object that each section configures, in the order of the pipeline.
        self.parts: dict[str, Parameterised] = {
            name: cls(**cls.defaults_for(of_object=ObjectSource.section in values))
            for name, cls in section_classes().items()
        }
        # Parts that are included in the program, connected or not.
        self.object = self.part(ObjectSource)
        self.cage, self.modal = self.part(TetraCage), self.part(ModalSolver)
        self.response, self.motion = self.part(ModalResponse), self.part(MotionReader)
        self.warp, self.surface = self.part(BarycentricWarp), self.part(PatchTessellator)
        self.view, self.animation = self.part(View), self.part(Animation)
        self.title = file.stem if file else ""
        #: Irregularity of the yarns that `data` returns; `irregular_data` sets it.
        self.irregularity_of_data: Irregularity | None = None
        #: By what they are about, see `spacemap_vtk.applicability.key_of_warning`.
        self._warnings: dict[str, str] = {}
        #: What warnings about limits say in this scene, by the limit's key; "" leaves one out.
        self.plain_warnings: dict[str, str] = {}
        #: Sections and keys that `assign` has changed; errors about them must not name the file.
        self.assigned: set[tuple[str | None, str | None]] = set()
        #: The scene's sections; `assign` adds more.
        self._sections = set(values)
        #: The state for which the stages are known to fit into memory.
        self._fits: tuple[int, ...] = ()
        #: The stages that are connected, from source to surface.
        self.stages: list[Stage] = []
        with self.add_file_to_errors():
            refuse_replaced(self.parts, self._sections)
            for name, value in values.items():
                if name == "title":
                    self.title = _clean_title(value)
                else:
                    self._write_section(name, value)
        self._connect()

    @classmethod
    def read(cls, scene: str | Path) -> Scene:
        """Read a scene file, a draft or a knit.

        Parameters
        ----------
        scene : str or Path
            A ``.toml`` scene, a ``.wif`` draft, a ``.k`` machine knitting file, a mesh such as
            ``model.ply``, or the name of a scene that comes with the program.

        Returns
        -------
        Scene
            The scene, connected but not yet updated.

        Raises
        ------
        InputError
            If the file is missing, is not TOML, or has unknown sections or keys.
        """
        path = library.find(scene)
        found = cls(library.values_of(path, path.name), path)
        found._add_warnings(library.notes_of(path))
        return found

    def part(self, cls: type[P]) -> P:
        """Return the object that a class's section configures.

        Parameters
        ----------
        cls : type
            A class with a section, such as `spacemap_vtk.WeaveSource`.

        Returns
        -------
        Parameterised
            The object of this scene, connected or not.
        """
        part = self.parts[cls.section]
        assert isinstance(part, cls)
        return part

    def stage(self, role: str) -> Stage | None:
        """Return the connected stage with a role.

        Parameters
        ----------
        role : str
            One of `spacemap_vtk.filters.base.ROLES`, or another that a stage declares.

        Returns
        -------
        Stage or None
            None if the scene has no such stage.
        """
        return next((stage for stage in self.stages if stage.role == role), None)

    @property
    def given_sections(self) -> tuple[str, ...]:
        """The sections of the scene."""
        return tuple(sorted(self._sections))

    @property
    def source(self) -> Stage:
        """The stage that makes the object."""
        return self.stages[0]

    @property
    def textile(self) -> Textile | None:
        """The source as a textile; None if it makes no yarns."""
        return self.source if isinstance(self.source, Textile) else None

    @property
    def woven(self) -> Woven | None:
        """The source as a textile of warp and weft; None if it is not woven."""
        return self.source if isinstance(self.source, Woven) else None

    @property
    def draft_file(self) -> Path | None:
        """The draft's file; None if there is none."""
        return None if self.textile is None else self.textile.draft_file

    @property
    def has_draft(self) -> bool:
        """Whether the source can be woven on a loom."""
        if self.woven is not None:
            return True  # also if the draft cannot be read: `draft` raises the error
        return self.textile is not None and self.textile.make_draft() is not None

    @property
    def moves(self) -> bool:
        """Whether there is a cage that moves."""
        return self.stage("mover") is not None

    @property
    def is_animated(self) -> bool:
        """Whether the cage moves in time; one that only hangs or lies in equilibrium does not."""
        mover, solver = self.stage("mover"), self.stage("solver")
        if isinstance(mover, ModalResponse) and isinstance(solver, ModalSolver):
            return not (solver.is_hung and mover.keeps_equilibrium(solver.gravity))
        return mover is not None

    @property
    def motion_stages(self) -> list[Stage]:
        """The stages from the mover of the cage to the warp of the object."""
        mover = self.stage("mover")
        return [] if mover is None else self.stages[self.stages.index(mover) : -1]

    @property
    def object_at_rest(self) -> Stage:
        """The stage that makes the object before a cage moves it."""
        rides = (n for n, s in enumerate(self.stages) if set(s.takes) == {"object", "cage"})
        still = self.stages[: next(rides, -1)]
        return next(stage for stage in reversed(still) if stage.makes == "object")

    @property
    def last_object(self) -> Stage:
        """The stage whose output becomes the surface: the object, moved if the scene moves."""
        return next(stage for stage in reversed(self.stages[:-1]) if stage.makes == "object")

    @property
    def arrays(self) -> dict[str, ProvidedArray]:
        """The arrays that the connected stages add, by name."""
        return {name: array for stage in self.stages for name, array in stage.arrays.items()}

    @property
    def warnings(self) -> list[str]:
        """Warnings of all updates so far, each sentence once."""
        return list(self._warnings.values())

    def set(self, assignment: str) -> None:
        """Change a value as ``--set`` does.

        Parameters
        ----------
        assignment : str
            ``section.key=value``, with the value as in a scene file; quotes may be left out.

        Raises
        ------
        InputError
            If the text has another form, the value is refused, or it belongs to a second source.
        """
        section, key, text = split_assignment(assignment)
        value = parse_value(text)
        self._refuse_replacement(section, key, value)
        self.assign(section, key, value)

    def _refuse_replacement(self, section: str, key: str, value: Any) -> None:
        """Refuse a value of a second source, which would replace that of the scene."""
        part = self.parts.get(section)
        if not isinstance(part, Stage) or part.role != ROLES[0] or section in self._sections:
            return
        found = find_replaced(self.parts, {*self._sections, section})
        if found is None:
            return
        other = found[0] if found[1] == section else found[1]
        cure = f'Start from a scene with [{section}] (see "spacemap scenes").'
        if isinstance(value, str) and registry.kind_of(Path(value)) is not None:
            cure = f'Open the file alone, as with "spacemap render {value} -o picture.png".'
        with add_section_to_errors(section):
            raise InputError(
                f"the scene has a section [{other}], and [{section}] cannot be combined with it",
                key=key,
                value=value,
                cure=cure,
            )

    def assign(self, section: str, key: str, value: Any) -> None:
        """Change a value. All changes go through here; errors about it do not name the file.

        If the section's stage was not connected, it is connected, as if the file had the section.

        Parameters
        ----------
        section, key : str
            Section and key of a scene file.
        value : object
            Value as in a scene file.

        Raises
        ------
        InputError
            If the value is refused.
        """
        self._write(section, key, value)
        self.assigned.add((section, key))
        self._check_camera(section)
        part = self.parts[section]
        if isinstance(part, Stage) and part not in self.stages:
            self._sections.add(section)
        self._connect()

    @property
    def settings(self) -> dict[str, dict[str, Any]]:
        """The values of all parameters, by section and name."""
        return {name: part.settings for name, part in self.parts.items()}

    def apply_settings(
        self,
        settings: Mapping[str, Mapping[str, Any]],
        sections: Collection[str] | None = None,
    ) -> None:
        """Take over the state of another scene; stages that are the same do not run again.

        Parameters
        ----------
        settings : mapping
            All of the other scene's `settings`, or those that differ.
        sections : collection of str, optional
            The other scene's sections, its `given`; by default those of this scene. A mapping also
            has the values that it gives in each section.
        """
        for section, values in settings.items():
            self.parts[section].configure(**values)
            if isinstance(sections, Mapping):
                self.parts[section].keep_given(sections.get(section, ()))
        self._sections = self._sections if sections is None else set(sections)
        self._connect()

    def update(self, time: float | None = None, piece: Piece | None = None) -> None:
        """Run the stages that need to run for a time.

        Parameters
        ----------
        time : float, optional
            Time in s; by default the last one.
        piece : Piece, optional
            Piece of the object; by default the last one, at first the whole.

        Raises
        ------
        SizeError
            If the stages together need more than the free memory.
        SpacemapError
            If a stage refuses its input; the message names the scene's file.
        """
        self._require_memory(1 if piece is None else piece.total)
        self.update_stage(self.stages[-1], time, piece)

    def _require_memory(self, pieces: int) -> None:
        """Refuse stages that do not fit into memory; once for the same yarns and subdivisions."""
        state = self.source.GetMTime(), self.surface.sides, len(self.stages), pieces
        if state != self._fits:
            with self.add_file_to_errors():
                require_stages(self.stages, pieces)
            self._fits = state

    def update_stage(
        self, stage: Stage, time: float | None = None, piece: Piece | None = None
    ) -> None:
        """Run the pipeline up to one of its stages.

        Parameters
        ----------
        stage : Stage
            One of `stages`.
        time : float, optional
            Time in s; by default the last one.
        piece : Piece, optional
            As for `update`.

        Raises
        ------
        SpacemapError
            If a stage refuses its input; the message names the scene's file.
        """
        with self.add_file_to_errors():
            self._check_color()
            stage.update(time, piece)
        for run in self.stages:
            self._add_warnings(run.warnings)

    def check(self) -> None:
        """Check what can be checked without running anything.

        A draft is valid whether or not its yarns fit. If the scene is a draft, an obstacle to
        drawing it is a warning.

        Raises
        ------
        SpacemapError
            If the draft cannot be read, the fabric is impossible, the cage's material is invalid,
            the damping is contradictory, or the animation has no frames.
        """
        with self.add_file_to_errors():
            found = self.find_obstacle()
            own = self.source.section
            draft = None if any(part == own for part, _ in self.assigned) else self.draft_file
            # A fabric that is too large can still be drawn: in parts, or from a distance.
            impossible = isinstance(found, GeometryError)
            if found is not None and impossible and (draft is None or draft != self.file):
                raise found
            self._check_color()
            for stage in self.stages:
                with add_section_to_errors(stage.section):
                    stage.check()
            with add_section_to_errors("animation"):
                self.animation.frame_times()

    @property
    def colorings(self) -> list[str]:
        """The possible colourings of the surface: keys of `COLORINGS`."""
        there = self.arrays
        return [
            name for name, color in COLORINGS.items() if not color.array or color.array in there
        ]

    def _check_camera(self, section: str) -> None:
        """Refuse the name of a camera that does not exist, once a section is complete."""
        if section == View.section:
            with add_section_to_errors(section):
                _ = self.view.saved_camera

    def _check_color(self) -> None:
        color = COLORINGS.get(self.view.color)
        if color is not None and not color.array:
            return  # this runs in every frame, and listing the arrays takes long
        with add_section_to_errors("view"):
            if self.view.color not in self.colorings:
                raise InputError(
                    "the scene does not have this quantity",
                    key="color",
                    value=self.view.color,
                    allowed=", ".join(self.colorings),
                )

    def _choose_color_array(self) -> None:
        """Let the warp interpolate an array of the cage that the colours show."""
        array = COLORINGS[self.view.color].array
        of_cage = {name for stage in self.stages if stage.makes == "cage" for name in stage.arrays}
        rides = array in of_cage and array not in self.warp.arrays
        self.warp.color_array = array if rides else ""

    def find_obstacle(self) -> GeometryError | SizeError | None:
        """Return the reason why the cloth cannot be built; builds nothing.

        Returns
        -------
        GeometryError, SizeError or None
            The yarns do not fit, or the patches do not fit into memory. None if neither is the
            case, or the scene is not woven. Warnings of the cloth, and a warning about the
            obstacle, are added to `warnings`.

        Raises
        ------
        SpacemapError
            If the draft cannot be read, or parameters contradict each other.
        """
        woven = self.woven
        if woven is None:
            return None
        found: GeometryError | SizeError
        what = "the cloth cannot be drawn, because its yarns do not fit"
        with self.add_file_to_errors(), add_section_to_errors(self.source.section):
            try:
                woven.cloth.check()
                self._add_warnings(woven.cloth.warnings)
            except GeometryError as error:
                found = error
            else:
                try:
                    _ = woven.counts
                    return None
                except SizeError as error:
                    found, what = error, "the cloth is too large for a file of its surface"
        found.section = self.source.section
        parameter = self.source.parameters.get(found.key or "")
        if isinstance(found.value, float) and parameter is not None:
            found.value = parameter.format(found.value)  # with its unit, as in errors of the stage
        self.warn(f"{what}: {found}")
        return found

    def warn(self, text: str) -> None:
        """Add a sentence to `warnings`, once.

        Parameters
        ----------
        text : str
            One sentence.
        """
        self._add_warnings([text])

    def _add_warnings(self, texts: Iterable[str]) -> None:
        for text in self.state_plainly(texts):
            add_warning(self._warnings, text)

    def state_plainly(self, texts: Iterable[str]) -> list[str]:
        """Replace warnings by those of `plain_warnings`.

        Parameters
        ----------
        texts : iterable of str
            Warnings of stages.

        Returns
        -------
        list of str
            What they say in this scene.
        """
        stated = (self.plain_warnings.get(key_of_warning(text), text) for text in texts)
        return [text for text in stated if text]

    @property
    def patches(self) -> vtkPointSet:
        """The Bézier patches or the object of the last update, moved if the scene moves."""
        return self.last_object.output

    @property
    def cage_stage(self) -> Stage:
        """The stage whose output is the warp's cage."""
        for stage in reversed(self.stages):
            if stage.makes == "cage":
                return stage
        raise InputError(
            "the scene has no cage",
            key="cage",
            cure='Add a section [cage], or "--set cage.divisions=[5,5,1]".',
        )

    @property
    def deformed_cage(self) -> vtkUnstructuredGrid:
        """The cage of the last update with its displacement; its points are at rest."""
        return self.cage_stage.output

    @property
    def draft(self) -> Draft:
        """The draft of the textile; no update is needed."""
        with self.add_file_to_errors(), add_section_to_errors(self.source.section):
            draft = None if self.textile is None else self.textile.make_draft()
            if draft is None:
                raise InputError(
                    f"{self.title}: the scene is not woven and has no draft",
                    cure="Open a draft, or a scene with a section [weave].",
                )
            self._add_warnings(draft.warnings)
            return draft

    def data(self, kind: str) -> Any:
        """Return the data for a key of `spacemap_vtk.io.registry.DATA`, as of the last update.

        Parameters
        ----------
        kind : str
            ``"patches"``, ``"surface"``, ``"cage"`` or ``"draft"``, or the name of an extension's
            data (`spacemap_vtk.extensions`), such as ``"analysis"``.

        Returns
        -------
        vtkDataSet, Draft or InputDeck
            The pipeline's object, not a copy.

        Raises
        ------
        InputError
            If the scene has no cage, or no draft that can be read.
        """
        look = self.irregularity_of_data
        if kind == "patches":
            return self.patches if look is None else self.surface.irregular(self.patches, look)
        if kind == "surface":
            return self.polygons if look is None else bake_brightness(self.polygons)
        if kind in ("cage", "draft"):
            return self.deformed_cage if kind == "cage" else self.draft
        return extensions.load("data", kind)(self)

    @property
    def picture(self) -> vtkImageData | None:
        """The object's picture; None if it shows its own colours."""
        return self.object.picture if self.source is self.object else None

    @property
    def polygons(self) -> vtkPolyData:
        """The surface of the last update."""
        return self.stages[-1].output

    def _write_section(self, section: str, values: Any) -> None:
        """Set the values of a section of a file."""
        part = require_part(self.parts, section)
        if not isinstance(values, Mapping):
            raise InputError(
                "must be a section",
                key=section,
                value=values,
                cure=f"Write [{section}] on its own line.",
            )
        folder = self.file.parent if self.file else Path()
        for key, value in values.items():
            with add_section_to_errors(section):
                value = part.parameter(key).resolve_path(value, folder)
            self._write(section, key, value)
        self._check_camera(section)

    def _write(self, section: str, key: str, value: Any) -> None:
        part = require_part(self.parts, section)
        with add_section_to_errors(section):
            part.set_from_scene(key, value)

    def _connect(self) -> None:
        stages = choose_stages(self.parts, self._sections)
        if stages != self.stages:
            self.stages = stages
            connect_stages(stages)
        self._choose_color_array()

    @contextmanager
    def add_file_to_errors(self) -> Iterator[None]:
        """Add this scene's file to errors, unless `assign` caused them.

        Yields
        ------
        None
            While the file is named.
        """
        try:
            yield
        except SpacemapError as error:
            assigned = (error.section, error.key) in self.assigned
            if error.file is None and self.file is not None and not assigned:
                error.file = str(self.file)
            raise


def _clean_title(value: Any) -> str:
    """Return a scene's title without control characters."""
    if not isinstance(value, str):
        raise InputError("must be a string", key="title", value=value)
    return "".join(c if c.isprintable() else " " for c in value)
