"""The command ``spacemap``."""

from __future__ import annotations

import errno
import gc
import io
import logging
import os
import re
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

from cyclopts import (
    App,
    CycloptsError,
    Group,
    MissingArgumentError,
    RepeatArgumentError,
    Token,
    UnknownOptionError,
    UnusedCliTokensError,
)

from spacemap_vtk import __version__, extensions
from spacemap_vtk.errors import InputError, SpacemapWarning, format_error
from spacemap_vtk.io.registry import describe_scene_files

app = App(
    name="spacemap",
    version=__version__,
    suppress_keyboard_interrupt=False,
    help=f"""Deform woven fabric by space mapping: pictures, films, data and figures.

    SCENE is {describe_scene_files()}, or the
    name of a built-in scene (see "spacemap scenes"). Numbers without a unit are in SI units; a
    unit can be given, for example "0.3 mm".

    For example:

        spacemap render plain_weave -o cloth.png
        spacemap render draft.wif --drape -o table.png
        spacemap animate plain_weave -o cloth.gif
        spacemap gui

    Solved modes are kept in the user's cache folder; with --no-cache it is neither read nor
    written.

    Exit status: 0 success, 2 invalid input, 1 any other failure.
    """,
    group_parameters=Group.create_default_parameters("Options"),
)
#: Commands in the order in which the help lists them, the most usual first.
COMMANDS = {
    "render": ("draw:render", "Draw a picture of a scene, a draft or a mesh."),
    "animate": ("draw:animate", "Make a film of a scene, or numbered frames."),
    "gui": ("window:gui", "Open the window, to see a scene move and to change it."),
    "info": (
        "reports:info",
        "Print the figures of a fabric or an object, and how a file was made.",
    ),
    "export": ("draw:export", "Write a scene's data for other programs."),
    "scenes": ("reports:scenes", "List the built-in scenes."),
    "yarns": ("plan:yarns", "List the yarns of the library, with counts, usual setts and sources."),
    "plan": (
        "plan:plan",
        "Plan a project: ends, reed, warp length and yarn by colour for a finished size.",
    ),
    "print": (
        "print_draft:print_draft",
        "Print a draft for the loom on as many pages as it needs.",
    ),
    "convert": ("draw:convert", "Convert a weaver's draft to another format."),
    "figure": (
        "figure:figure",
        "Lay out a page for a publication: pictures, draft and cloth, Peirce's sections.",
    ),
    "storyboard": (
        "draw:storyboard",
        "Draw the motion of a scene as a row of pictures at several times.",
    ),
    "sweep": ("sweep:sweep", "Run a scene for lists of values, with a table and a contact sheet."),
    "plot": ("modes:plot", "Plot the motion of a point and its frequency response."),
    "modes": ("modes:modes", "Print the vibration modes of a scene's cage."),
    "measure": (
        "measure:measure",
        "Measure a cloth as the instruments of a textile laboratory do.",
    ),
    "constants": (
        "constants:constants",
        "Compute the elastic constants of a composite with a textile in it.",
    ),
    "unit-cell": (
        "constants:unit_cell",
        "Write one repeat of a textile in a matrix as voxels, or as a deck of a solver.",
    ),
    "permeability": (
        "constants:permeability",
        "Compute how easily a fluid flows through a textile between its yarns.",
    ),
    "validate": ("reports:validate", "Check a scene without drawing it."),
    "keys": ("reports:keys", "Explain the sections and keys of scene files."),
    "materials": ("reports:materials", "List the measured fabrics that a cage can be made of."),
    "again": ("remake:remake", "Repeat the command that made a file."),
    "completion": ("completion:completion", "Print the completion script for bash, zsh or fish."),
}
for _number, (_name, (_function, _help)) in enumerate(COMMANDS.items()):
    # By name, so that a command's module is imported when it is called, not for other commands.
    app.command(f"spacemap_vtk.cli.{_function}", name=_name, help=_help, sort_key=_number)
#: Commands of optional parts and of other packages, with the place of each one's function.
EXTENSIONS = {
    each.name: each.value for each in extensions.members("commands") if each.name not in COMMANDS
}
for _name, _function in EXTENSIONS.items():
    app.command(_function, name=_name)

#: Names of output files in messages.
_FILES = {
    "spacemap render": "picture.png",
    "spacemap animate": "film.gif",
    "spacemap export": "cloth.glb",
}
_NULL_HANDLER = logging.NullHandler()
#: Errors of the stream to which a command prints, for example a file or another program.
_STREAM_ERRORS = (errno.ENOSPC, errno.EFBIG, errno.EIO, errno.EPIPE)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line, by default that of the process, and exit with 0, 1 or 2."""
    if arguments is None:
        # Commands make hardly any garbage, so it is enough to look for it seldom.
        gc.set_threshold(20_000, 20, 20)
        _open_streams()
        survive_memory_limit()
    # Libraries log, for example, folders that cannot be written to. This is no message for users.
    logging.getLogger().addHandler(_NULL_HANDLER)
    words = list(sys.argv[1:] if arguments is None else arguments)
    if "--no-cache" in words:
        # Handled here for all commands, so that none has to pass it on.
        from spacemap_vtk.cache import VARIABLE

        words.remove("--no-cache")
        os.environ[VARIABLE] = "off"
    try:
        if words and words[0] in COMMANDS:
            # The table's sentence is for lists of commands; a command's own help contains it.
            app[words[0]].help = None
        elif not words or words[0] not in EXTENSIONS:
            # Lists of commands show docstrings of extensions only after these are imported.
            for name in EXTENSIONS:
                with suppress(ImportError):  # calling the command shows the error
                    app[name]
        with warnings.catch_warnings():
            # Commands and the window report the warnings of stages in their own way.
            warnings.simplefilter("ignore", SpacemapWarning)
            with _raise_interrupts():
                app(words, exit_on_error=False, print_error=False, result_action="return_value")
        if sys.stdout is not None:  # None if it is closed
            sys.stdout.flush()
    except CycloptsError as error:
        _print_error(_usage_message(error))
        sys.exit(2)
    except InputError as error:
        _print_error(error)
        sys.exit(2)
    except KeyboardInterrupt:
        _print_error("stopped")
        sys.exit(1)
    except Exception as error:
        if isinstance(error, OSError) and error.filename is None and error.errno in _STREAM_ERRORS:
            if not isinstance(error, BrokenPipeError):  # the reader has closed the pipe on purpose
                _print_error(f"the output could not be printed: {str(error.strerror).lower()}")
            _discard_output()
        elif isinstance(error, OSError) and error.filename is not None and error.strerror:
            _print_error(f"{os.fsdecode(error.filename)}: {error.strerror.lower()}")
        else:
            _print_error(error)
        sys.exit(1)
    sys.exit(0)


def _open_streams() -> None:
    """Connect closed streams to the null device; write unencodable characters as "?"."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:  # otherwise the next file to be opened would get what libraries print
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    for number, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w", encoding="utf-8", closefd=False))
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="replace")


def survive_memory_limit() -> None:
    """Continue in a copy of this process if memory is limited, and report how the copy ends."""
    # VTK's C++ code aborts if it gets no memory, and the aborted process cannot report it.
    try:
        import resource  # not on Windows
    except ImportError:
        return
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    if most == resource.RLIM_INFINITY:
        return
    child = os.fork()  # there are no threads yet
    if child == 0:
        resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to both processes
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: os.kill(child, number))
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if -code in (signal.SIGABRT, signal.SIGSEGV, signal.SIGTRAP):
        _print_error(
            f"out of memory: this shell limits a process to {most / 2**30:.3g} GiB (ended by "
            f'{signal.Signals(-code).name}). Raise the limit with "ulimit -v unlimited".'
        )
        code = 1
    if code < 0:
        signal.signal(-code, signal.SIG_DFL)
        os.kill(os.getpid(), -code)
    os._exit(code)


@contextmanager
def _raise_interrupts() -> Iterator[None]:
    """Turn an error that Ctrl-C caused in Python code called by VTK into KeyboardInterrupt."""
    heard = []

    def on_interrupt(number: int, frame: FrameType | None) -> None:
        heard.append(number)
        signal.default_int_handler(number, frame)

    usual = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    hears = usual and threading.current_thread() is threading.main_thread()
    shown = sys.excepthook
    if hears:
        signal.signal(signal.SIGINT, on_interrupt)
        # Since Python 3.13 VTK prints the interrupt and then fails.
        sys.excepthook = lambda kind, *rest: None if heard else shown(kind, *rest)
    try:
        yield
    except Exception:
        if heard:
            raise KeyboardInterrupt from None
        raise
    finally:
        if hears:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            sys.excepthook = shown


def _usage_message(error: CycloptsError) -> str:
    """Return what is wrong with the command line, and how to get help."""
    from spacemap_vtk.cli.options import (
        SEVERAL_TIMES_HINT,  # imports modules that --version does not need
    )

    command = " ".join(["spacemap", *(error.command_chain or ())])
    text, argument = str(error), error.argument
    if isinstance(error, UnusedCliTokensError):
        text = f'"{command}" does not accept "{" ".join(error.unused_tokens or ())}".'
    elif isinstance(error, MissingArgumentError) and argument and not error.keyword:
        text = _missing_message(error, command, argument.name)
    elif isinstance(error, RepeatArgumentError):
        text = f"{error.token.keyword} can be given only once."
        if error.token.keyword == "--time":
            text += f" {SEVERAL_TIMES_HINT}"
    elif isinstance(error, UnknownOptionError) and error.token.keyword == "--times":
        text = f'"{command}" does not support --times. {SEVERAL_TIMES_HINT}'
    return f'{text} See "{command} --help".'


def _missing_message(error: MissingArgumentError, command: str, missing: str) -> str:
    """Return what is missing, or which unknown option is the likely reason."""
    words = error.unused_tokens or []
    unknown = next((word for word in words if re.match(r"--?[a-zA-Z]", word)), None)
    if unknown is not None:
        token = Token(keyword=unknown.partition("=")[0], source="cli")
        known = app[command.removeprefix("spacemap ")].assemble_argument_collection()
        return str(UnknownOptionError(token=token, argument_collection=known, verbose=False))
    file = next((word for word in words if Path(word).suffix), _FILES.get(command))
    example = f", for example -o {file}" if file and missing == "--output" else ""
    return f'"{command}" needs {missing}{example}.'


def _discard_output() -> None:
    """Discard what waits to be printed; otherwise Python would try again and report an error."""
    with suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _print_error(error: BaseException | str) -> None:
    with suppress(OSError):  # the exit status shows the failure, too
        text = format_error(error) if isinstance(error, BaseException) else " ".join(error.split())
        print(f"spacemap: {text}", file=sys.stderr)
