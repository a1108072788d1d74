# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``blender scene.blend --command tetflora refine|render|stats|export``: TetFlora for scripts and render farms.

Exit codes: 0 done, 1 the scene or a file cannot be used, 2 wrong arguments. An error is one line on stderr. With
``--json`` the last line on stdout is a JSON object, after Blender's own output.
"""

import argparse
import json
import os
import re
import sys
from collections.abc import Sequence
from dataclasses import asdict
from itertools import takewhile
from pathlib import Path
from typing import Any

import bpy

from ...errors import VALUE, SceneError, TetFloraError, readable
from .. import compat, properties, runtime, saved_files, worker
from ..export.forest import LEVELS, MOST_VARIANTS, WRITERS, ExportOrder, export_steps
from ..job.contents import estimate
from ..job.refine import refine
from ..scene.camera import read_camera

#: First, last and step of frames.
Run = tuple[int, int, int]

#: Last frame in Blender.
LAST_FRAME = 1_048_574

_NUMBER = r"[0-9]{1,9}"  # what Python makes of more digits, or of others, is of no use
_RUN = re.compile(rf"(-?{_NUMBER})(?:-(-?{_NUMBER})(?::({_NUMBER}))?)?")
#: Frames of Blender, those below zero included.
_MOST_FRAMES = 2 * LAST_FRAME + 1


def frame_runs(text: str) -> list[Run]:
    """Read a range expression: ``1-10``, ``7``, ``1-99:2``, or several with commas.

    Parameters
    ----------
    text : str
        As in the specification (section 3.4.1.1.1), without negative steps.

    Returns
    -------
    list of tuple
        First, last and step, in the order of the text; the last is a frame of its run.

    Raises
    ------
    ValueError
        Another expression, a range that runs backwards, a frame that Blender does not have, or more frames than it has.
    """
    runs, number = [], 0
    quoted = readable(text, VALUE)
    for part in text.split(","):
        match = _RUN.fullmatch(part.strip())
        if match is None:
            raise ValueError(f"{quoted} is not a range of frames such as 1-24, 7 or 1-99:2")
        first = int(match[1])
        last = first if match[2] is None else int(match[2])
        step = int(match[3] or 1)
        if last < first or step < 1:
            raise ValueError(f"{quoted} is not a range of frames such as 1-24, 7 or 1-99:2")
        if max(-first, last) > LAST_FRAME:
            raise ValueError(f"{quoted} exceeds the last frame that Blender supports, {LAST_FRAME:,}")
        number += (last - first) // step + 1
        if number > _MOST_FRAMES:
            raise ValueError(f"{quoted} names frames again and again: Blender has only {_MOST_FRAMES:,}")
        runs.append((first, last - (last - first) % step, step))
    return runs


def frame_numbers(runs: Sequence[Run]) -> list[int]:
    """All frames of runs, repeated ones included."""
    return [frame for first, last, step in runs for frame in range(first, last + 1, step)]


NAME = "tetflora"
#: Largest number of samples in Cycles.
_MAX = 1 << 24

_command: Any = None


class Parser(argparse.ArgumentParser):
    """Reports errors in one line, like all others."""

    def error(self, message: str) -> None:
        """End with the message and the exit code of wrong arguments."""
        raise SystemExit(_fail(f"{message}; see --help", 2))


def main(arguments: Sequence[str]) -> int:
    """Run one command, which follows ``--command tetflora``, on the open file; returns the exit code, see above."""
    return run(_parser(), arguments)


def run(parser: Parser, arguments: Sequence[str]) -> int:
    """Run what the option ``run`` of a parser names, and print its figures; returns the exit code."""
    try:
        options = parser.parse_args(list(arguments))
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else 0
    try:
        _check_file()
        figures = options.run(options)
    except (TetFloraError, OSError) as error:
        return _fail(str(error), 1)
    except RuntimeError as error:
        # Blender's operators raise "Error: ...", over several lines.
        return _fail(" ".join(str(error).split()).removeprefix("Error: "), 1)
    if figures is None:
        return 1
    try:
        if options.json:
            print(json.dumps(figures), flush=True)
        else:
            for key, value in figures.items():
                if key not in ("steps", "levels"):  # a dozen figures for each pass, for programs
                    print(f"{key.replace('_', ' '):>22}: {_readable(value)}", flush=True)
    except OSError as error:  # into a file on a full disk, or into a program that has ended
        return _fail(f"cannot print the statistics: {error.strerror}", 1)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog=f"blender FILE --command {NAME}",
        description="Refine and render the plants of a scene, in the file that Blender has opened.",
    )
    commands = parser.add_subparsers(title="commands", required=True, metavar="refine|render|stats|export")

    refining = commands.add_parser("refine", help="create meshes of the plants for the scene camera")
    refining.add_argument("--cutoff", type=positive, metavar="PIXELS", help="override the Cutoff of the scene")
    refining.add_argument("--save", metavar="PATH", help="save a copy of the file with the results")
    refining.set_defaults(run=_refine)

    render = commands.add_parser("render", help="refine and render frames")
    which = render.add_mutually_exclusive_group()
    which.add_argument(
        "--frame", type=_frame, metavar="N", help="frame to render (default: current frame of the scene)"
    )
    which.add_argument("--frames", type=frames, metavar="A-B", help="frames to render, like 1-24, 1-99:2 or 3,7-9")
    render.add_argument("--engine", choices=("cycles", "eevee"), help="override the render engine of the scene")
    render.add_argument("--samples", type=whole, metavar="N", help="override the number of samples per pixel")
    render.add_argument("--output", metavar="PATH", help="output folder or file name; #### is the frame")
    about = "render existing images again, even if Overwrite is off in the scene"
    render.add_argument("--overwrite", action="store_true", help=about)
    render.set_defaults(run=_render)

    stats = commands.add_parser(
        "stats", help="count plants, their polygons and instances of assets without changing anything"
    )
    stats.set_defaults(run=_stats)

    exporting = commands.add_parser("export", help="write the plants for other programs")
    exporting.add_argument("path", metavar="PATH", help=f"file to write; its ending is one of {' '.join(WRITERS)}")
    exporting.add_argument("--variants", type=whole, default=8, metavar="N", help="plants of each species (default: 8)")
    exporting.add_argument("--levels", type=whole, default=0, metavar="N", help="levels of detail, with the full plant")
    about = "leave out levels of detail with more polygons"
    exporting.add_argument("--polygons", type=whole, default=0, metavar="N", help=about)
    exporting.add_argument("--flat", action="store_true", help="do not bake veins, bark and relief")
    exporting.set_defaults(run=_export)

    for command in (refining, render):
        command.add_argument("--proxies", choices=_choices("proxy_kind"), help="override the proxy kind of the scene")
        about = "override the Lighting of the scene"
        command.add_argument("--baked-light", choices=_choices("baked_light"), help=about)
    for command in (refining, render, stats, exporting):
        command.add_argument("--json", action="store_true", help="print statistics as a JSON object in the last line")
    return parser


def _refine(options: argparse.Namespace) -> dict:
    scene = bpy.context.scene
    if options.cutoff is not None:
        scene.tetflora.cutoff = options.cutoff
    _set_proxies(scene, options)
    target = None if options.save is None else _named(options.save)
    if target is not None:
        if not target.parent.is_dir():  # before the work
            raise SceneError(f"The folder {target.parent} does not exist; create it or choose another")
        if target.is_dir():
            raise SceneError(f"{target} is a folder; add a file name")
    statistics = refine(scene, bpy.context.evaluated_depsgraph_get())
    if target is not None:
        scene.tetflora.output.save_results = True
        saved_files.write_blend(target, lambda path: bpy.ops.wm.save_as_mainfile(filepath=path, copy=True))
    if statistics.unknown:
        raise SceneError(statistics.unknown)
    return asdict(statistics)


def _render(options: argparse.Namespace) -> dict | None:
    scene = bpy.context.scene
    # Blender's own message about a missing camera comes late and is hard to read.
    read_camera(scene, bpy.context.evaluated_depsgraph_get())
    scene.tetflora.refine_at_render = True
    _set_proxies(scene, options)
    if options.engine is not None:
        scene.render.engine = 'CYCLES' if options.engine == "cycles" else compat.eevee_engine()
    if options.samples is not None:
        if scene.render.engine in compat.EEVEE_ENGINES:
            scene.eevee.taa_render_samples = options.samples
        elif scene.render.engine == 'CYCLES':
            scene.cycles.samples = options.samples
        else:
            raise SceneError(f"The engine {scene.render.engine} has no samples; choose one with --engine")
    if options.output is not None:
        scene.render.filepath = _place(options.output)
    if options.overwrite:
        scene.render.use_overwrite = True
    if options.frames is not None:
        rendered = [_animation(scene, run) for run in options.frames]
        files = [name for names, _ in rendered for name in names]
        whole = all(whole for _, whole in rendered)
    else:
        if scene.render.is_movie_format:
            raise SceneError("The output format is a movie; set the frames with --frames, or choose an image format")
        if options.frame is not None:
            scene.frame_set(options.frame)
        # Blender leaves #### as it is in stills.
        name, whole = _still(scene, _still_path(scene))
        files = [name]
    paths = [Path(bpy.path.abspath(f)) for f in files]
    for path in saved_files.damaged(scene, paths):
        raise SceneError(f"{path} is incomplete; check the free disk space")
    if not whole:
        return None  # reported on stderr before
    return {"files": list(map(str, paths)), **json.loads(scene.tetflora.statistics or "{}")}


def _stats(_options: argparse.Namespace) -> dict:
    statistics = estimate(bpy.context.scene, bpy.context.evaluated_depsgraph_get())
    return {name: getattr(statistics, name) for name in ("plants", "polygons_full", "instances")}


def _export(options: argparse.Namespace) -> dict:
    if options.variants > MOST_VARIANTS or options.levels > LEVELS:
        raise SceneError(f"There are at most {MOST_VARIANTS:,} variants and {LEVELS} levels; give a smaller number")
    order = ExportOrder(_named(options.path), options.variants, options.levels, options.polygons, not options.flat)
    exported = worker.run_to_end(export_steps(bpy.context.scene, bpy.context.evaluated_depsgraph_get(), order))
    return asdict(exported) | {"path": str(exported.path)}


def _check_file() -> None:
    """Refuse to go on where Blender could not open the file, and would render its default cube instead."""
    before = takewhile(lambda text: text not in ("--command", "--"), sys.argv)
    named = [text for text in before if re.search(r"\.blend\d*$", text)]
    if named and not bpy.data.filepath:
        raise SceneError(f"{named[-1]} cannot be opened; see Blender's message above")


def _animation(scene: bpy.types.Scene, run: Run) -> tuple[list[str], bool]:
    """Render a run of frames: its files, and whether all of them have their plants."""
    first, last, step = run
    stills = []
    while first <= min(last, -1):  # Blender's range of frames cannot begin below 0
        scene.frame_set(first)
        stills.append(_still(scene, scene.render.frame_path(frame=first)))
        first += step
    files, whole = [name for name, _ in stills], all(whole for _, whole in stills)
    if first <= last:
        scene.frame_start, scene.frame_end, scene.frame_step = first, last, step
        bpy.ops.render.render(animation=True)
        whole = whole and not runtime.failed_frames
        names = [scene.render.frame_path(frame=n) for n in frame_numbers([(first, last, step)])]
        files += dict.fromkeys(names)  # all of a movie are one
    return files, whole


def _still(scene: bpy.types.Scene, path: str) -> tuple[str, bool]:
    """Render the frame of the scene: its file, and whether it has its plants."""
    before, scene.render.filepath = scene.render.filepath, path
    bpy.ops.render.render(write_still=True)
    scene.render.filepath = before
    return bpy.path.ensure_ext(path, scene.render.file_extension), not runtime.failed_frames


def _named(text: str) -> Path:
    """Absolute path of an argument; // is relative to the .blend."""
    return Path(bpy.path.abspath(text)).absolute()


def _place(text: str) -> str:
    """Output path of a render; Blender needs a slash at the end of a folder."""
    path = _named(text)
    return f"{path}{os.sep}" if text.endswith(("/", os.sep)) or path.is_dir() else str(path)


def _still_path(scene: bpy.types.Scene) -> str:
    folder, name = os.path.split(bpy.path.abspath(scene.render.filepath))
    frame = scene.frame_current
    # In a folder, the name of an image is its frame, as in animations.
    return os.path.join(folder, re.sub(r"#+", lambda match: f"{frame:0{len(match.group())}d}", name or "####"))


def _set_proxies(scene: bpy.types.Scene, options: argparse.Namespace) -> None:
    if options.proxies is not None:
        scene.tetflora.proxy_kind = options.proxies.upper()
    if options.baked_light is not None:
        scene.tetflora.baked_light = options.baked_light.upper()


def _choices(name: str) -> list[str]:
    return [item.identifier.lower() for item in properties.TetFloraScene.bl_rna.properties[name].enum_items]


def positive(text: str) -> float:
    """A number greater than 0 of an option."""
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not a number greater than 0")
    return value


def whole(text: str) -> int:
    """A whole number from 1 of an option."""
    value = int(text)
    if not 1 <= value <= _MAX:
        raise argparse.ArgumentTypeError(f"{text} is not a number from 1 to {_MAX:,}")
    return value


def _frame(text: str) -> int:
    value = int(text)
    if abs(value) > LAST_FRAME:
        raise argparse.ArgumentTypeError(f"{text} exceeds the last frame that Blender supports, {LAST_FRAME:,}")
    return value


def frames(text: str) -> list[Run]:
    """Runs of frames of an option."""
    try:
        return frame_runs(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _readable(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {_readable(item)}" for key, item in value.items())
    if isinstance(value, list):
        return " ".join(map(str, value)) or "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:,.2f}" if isinstance(value, float) else f"{value:,}" if isinstance(value, int) else str(value)


def _fail(message: str, code: int) -> int:
    print(f"tetflora: error: {message}", file=sys.stderr, flush=True)
    return code


def register() -> None:
    """Register ``--command tetflora``."""
    global _command
    _command = bpy.utils.register_cli_command(NAME, main)


def unregister() -> None:
    """Remove the command; 4.5 hangs at exit otherwise."""
    bpy.utils.unregister_cli_command(_command)
