"""The command ``completion``: what makes a shell complete commands, options, scenes and keys.

All of it is read off the commands' declarations once, and printed: a shell asks no Python while
somebody types. zsh runs bash's function, which is why that keeps to what both know.
"""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, get_args

from cyclopts import Parameter

Shell = Literal["bash", "zsh", "fish"]

_BASH = """\
_spacemap() {{
  local cur="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}" words="" files=""
  # bash takes --set modal.elements=sheet apart at its equals sign
  if [ "$cur" = "=" ]; then cur=""
  elif [ "$before" = "=" ]; then before="${{COMP_WORDS[COMP_CWORD-2]}}"
  fi
  if [ "$COMP_CWORD" -eq 1 ]; then words={commands}
  else
    case "$before" in
{values}
    *) case "${{COMP_WORDS[1]}} $cur" in
{places}
      esac;;
    esac
  fi
  COMPREPLY=( $(compgen -W "$words" -- "$cur") )
  if [ -n "$files" ]; then
    local IFS=$'\\n'
    COMPREPLY+=( $(compgen -f -- "$cur") )
    type compopt >/dev/null 2>&1 && compopt -o filenames
  fi
  case "${{COMPREPLY[0]}}" in *=) type compopt >/dev/null 2>&1 && compopt -o nospace;; esac
  return 0
}}
complete -F _spacemap spacemap"""


class Answers(NamedTuple):
    """What can stand in a place of the command line."""

    words: tuple[str, ...] = ()
    files: bool = False

    @property
    def line(self) -> str:
        """The words, quoted."""
        return shlex.quote(" ".join(self.words))


def completion(shell: Annotated[Shell, Parameter(help="The shell.")], /) -> None:
    """Print what makes bash, zsh or fish complete words: commands, options, scenes, keys, files.

    bash: spacemap completion bash > ~/.local/share/bash-completion/completions/spacemap;
    zsh: eval "$(spacemap completion zsh)", in ~/.zshrc;
    fish: spacemap completion fish > ~/.config/fish/completions/spacemap.fish.
    """
    print(_fish() if shell == "fish" else _bash(zsh=shell == "zsh"))


def _known() -> dict[str, Answers]:
    """Return what stands for arguments whose type does not tell it, and after ``--set key=``."""
    from spacemap_vtk.io import registry
    from spacemap_vtk.scenes import library
    from spacemap_vtk.scenes.chain import sections
    from spacemap_vtk.scenes.colorings import COLORINGS
    from spacemap_vtk.scenes.styles import STYLES

    kinds = sections()
    keys = {f"{s}.{name}": p for s, kind in kinds.items() for name, p in kind.parameters.items()}
    choices = {key: getattr(p, "choices", ()) for key, p in keys.items()}
    return {
        **{key: Answers(tuple(w for w in words if " " not in w)) for key, words in choices.items()},
        "--set": Answers(tuple(f"{key}=" for key in keys)),
        "--style": Answers(tuple(STYLES)),
        "--color": Answers(tuple(COLORINGS)),
        "--what": Answers(tuple(registry.DATA)),
        "SCENE": Answers(tuple(library.names()), files=True),
        "NAME": Answers(tuple(library.names())),
        "SECTION": Answers(tuple(kinds)),
    }


def _arguments() -> dict[str, dict[str, tuple[Any, Answers]]]:
    """Return of each command its arguments by name, and what they can be."""
    from spacemap_vtk.cli.main import COMMANDS, app

    known = _known()
    return {
        command: {
            name: (argument, known.get(name) or Answers(*_typed(argument.hint)))
            for argument in app[command].assemble_argument_collection()
            for name in argument.names
        }
        for command in COMMANDS
    }


def _typed(hint: Any) -> tuple[tuple[str, ...], bool]:
    words = tuple(word for word in get_args(hint) if isinstance(word, str))
    return words, Path in (hint, *get_args(hint))


def _bash(zsh: bool) -> str:
    names: dict[Answers, list[str]] = {}
    for key, answers in _known().items():
        if "." in key and answers.words:
            names.setdefault(answers, []).append(key)
    places = []
    arguments = _arguments()
    for command, own in arguments.items():
        options = [name for name in own if name.startswith("-")]
        places.append(f'    "{command} -"*) words={shlex.quote(" ".join([*options, "--help"]))};;')
        for name, (argument, answers) in own.items():
            if name not in options:
                places.append(f'    "{command} "*) {_answer(answers)};;')
            elif argument.hint is not bool and name not in names.setdefault(answers, []):
                names[answers].append(name)
    script = _BASH.format(
        commands=shlex.quote(" ".join([*arguments, "--help", "--version"])),
        values="\n".join(f"    {'|'.join(n)}) {_answer(a)};;" for a, n in names.items()),
        places="\n".join(places),
    )
    begin = "autoload -U +X compinit && compinit\nautoload -U +X bashcompinit && bashcompinit\n"
    return begin + script if zsh else script


def _answer(answers: Answers) -> str:
    return f"words={answers.line} files={'1' if answers.files else ''}"


def _fish() -> str:
    from spacemap_vtk.cli.main import COMMANDS

    begin = "complete -c spacemap -n __fish_use_subcommand -f"
    lines = [f"{begin} -a {name} -d {shlex.quote(help)}" for name, (_, help) in COMMANDS.items()]
    for command, own in _arguments().items():
        begin = f"complete -c spacemap -n '__fish_seen_subcommand_from {command}'"
        for name, (argument, answers) in own.items():
            line = begin
            if name.startswith("-"):
                line += f" {'-l' if name.startswith('--') else '-s'} {name.lstrip('-')}"
                line += f" -d {shlex.quote(argument.parameter.help or '')}"
            if argument.hint is not bool:
                line += " -r -F" if answers.files else " -x"
                line += f" -a {answers.line}" if answers.words else ""
            lines.append(line)
    return "\n".join(lines)
