"""Jobs: each makes a picture, a film, a figure, a plot or a data file from a scene.

Each kind of job is one class, registered under the name of the kind. A new kind is a module with
one class that `register` decorates; the built-in kinds are imported here.
"""

from spacemap_vtk.jobs.data import DataJob, make_data_job
from spacemap_vtk.jobs.figure import FigureJob
from spacemap_vtk.jobs.film import FilmJob
from spacemap_vtk.jobs.job import JOBS, Context, Job, Times, job_from_json, make_job, register
from spacemap_vtk.jobs.measure import MeasureJob
from spacemap_vtk.jobs.moving_surface import ModesJob, MovingJob
from spacemap_vtk.jobs.picture import PictureJob
from spacemap_vtk.jobs.plan import PlanJob
from spacemap_vtk.jobs.plot import BiaxialJob, PlotJob, ReactionsJob
from spacemap_vtk.jobs.print_draft import PrintJob
from spacemap_vtk.jobs.sheets import ShapesJob, StoryboardJob
from spacemap_vtk.jobs.sweep_job import SweepJob
from spacemap_vtk.jobs.unit_cell import CompositeMapJob, ConstantsJob, UnitCellJob

__all__ = [
    "JOBS",
    "BiaxialJob",
    "CompositeMapJob",
    "ConstantsJob",
    "Context",
    "DataJob",
    "FigureJob",
    "FilmJob",
    "Job",
    "MeasureJob",
    "ModesJob",
    "MovingJob",
    "PictureJob",
    "PlanJob",
    "PlotJob",
    "PrintJob",
    "ReactionsJob",
    "ShapesJob",
    "StoryboardJob",
    "SweepJob",
    "Times",
    "UnitCellJob",
    "job_from_json",
    "make_data_job",
    "make_job",
    "register",
]
