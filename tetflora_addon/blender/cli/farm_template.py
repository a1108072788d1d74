# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The text of a job for a render farm: Open Job Description, jobtemplate-2023-09, and what frames it is about.

Source: Open Job Description, "Template Schemas 2023-09" and its extension TASK_CHUNKING
(github.com/OpenJobDescription/openjd-specifications). The two files beside the template are those of a job bundle of
AWS Deadline Cloud. All are JSON, which the specification takes as well as YAML; Blender's Python writes no YAML.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...errors import SceneError

#: Folder of the bundle that holds what a worker needs besides Blender and the scene.
FILES = "tetflora"
#: Script in it that installs the extension.
INSTALLER = "install_tetflora.py"
#: Folder of the bundle that the scene and what it uses are copied to.
SCENE_FOLDER = "scene"
OUTPUT_FOLDER = "output"
STEP = "Render"

#: First, last and step of frames.
Run = tuple[int, int, int]

#: Last frame that Blender has.
MOST_FRAME = 1_048_574

_RUN = re.compile(r"(-?\d+)(?:-(-?\d+)(?::(\d+))?)?")
_LONGEST_NAME = 128


@dataclass(frozen=True)
class Job:
    """What a template is filled with.

    Attributes
    ----------
    name : str
        Shown by the scheduler.
    frames : str
        Range expression, see `frame_runs`.
    chunk : int
        Most frames that one worker renders in one go.
    picture_name : str
        File name of the pictures; ``####`` is the frame.
    scene : str or None
        The .blend within the bundle, relative and with slashes; None if it stays where it is.
    """

    name: str
    frames: str
    chunk: int
    picture_name: str
    scene: str | None


def frame_runs(text: str) -> list[Run]:
    """Read a range expression: ``1-10``, ``7``, ``1-99:2``, or several with commas.

    Parameters
    ----------
    text : str
        As the specification has it (section 3.4.1.1.1), without negative steps.

    Returns
    -------
    list of tuple
        First, last and step, in the order in which they are written; the last is a frame of its run.

    Raises
    ------
    ValueError
        It is no such expression, a range runs backwards, or Blender has no such frame.
    """
    runs = []
    for part in text.split(","):
        match = _RUN.fullmatch(part.strip())
        if match is None:
            raise ValueError(f"{text} is not a range of frames such as 1-24, 7 or 1-99:2")
        first = int(match[1])
        last = first if match[2] is None else int(match[2])
        step = int(match[3] or 1)
        if last < first or step < 1:
            raise ValueError(f"{text} is not a range of frames such as 1-24, 7 or 1-99:2")
        if max(-first, last) > MOST_FRAME:
            raise ValueError(f"{text} exceeds the last frame that Blender supports, {MOST_FRAME:,}")
        runs.append((first, last - (last - first) % step, step))
    return runs


def frame_numbers(runs: Sequence[Run]) -> list[int]:
    """All frames of runs, as often as they are named."""
    return [frame for first, last, step in runs for frame in range(first, last + 1, step)]


def frame_expression(runs: Sequence[Run]) -> str:
    """The opposite of `frame_runs`: the shortest expression of each run, no frame twice.

    Raises
    ------
    SceneError
        There is no frame, or one is in two runs: OpenJD makes a task of a frame once.
    """
    numbers = frame_numbers(runs)
    if not numbers:
        raise SceneError("No frames to render; raise the End frame of the scene, or use --frames")
    if len(set(numbers)) < len(numbers):
        twice = next(n for n in numbers if numbers.count(n) > 1)
        raise SceneError(f"Frame {twice} occurs twice in --frames; list each frame once")
    runs = [(first, last - (last - first) % step, step) for first, last, step in runs if last >= first]
    return ",".join(
        str(first) if first == last else f"{first}-{last}" + (f":{step}" if step > 1 else "")
        for first, last, step in runs
    )


def job_name(stem: str) -> str:
    """A name that a template may hold: braces would be read as a variable, control characters are refused."""
    text = re.sub(r"\{\{|\}\}|[\x00-\x1f\x7f-\x9f]", " ", stem).strip()
    return f"{text or 'scene'} (TetFlora)"[:_LONGEST_NAME]


def template(job: Job) -> dict[str, Any]:
    """The job template.

    Its one environment gives Blender a folder of resources of its own inside the session and installs the extension
    there: neither the worker's own add-ons nor its preferences are read or changed. Each task is one Blender. Chunks
    need the extension TASK_CHUNKING of the specification, so that a job of single frames does without.
    """
    chunked = job.chunk > 1
    frame: dict[str, Any] = {"name": "Frame", "type": "INT", "range": "{{Param.Frames}}"}
    if chunked:
        frame["type"] = "CHUNK[INT]"
        # Frames of a step, or left out by hand, would come one by one if chunks had to be without gaps.
        frame["chunks"] = {"defaultTaskCount": "{{Param.ChunkSize}}", "rangeConstraint": "NONCONTIGUOUS"}
    installer = f"{{{{Param.TetFloraFiles}}}}/{INSTALLER}"
    install = ["--background", "--python-exit-code", "1", "--python", installer]
    render = ["--background", "{{Param.SceneFile}}", "--command", "tetflora", "render", "--overwrite"]
    # With "=": frames below zero begin with a dash.
    render += ["--frames={{Task.Param.Frame}}", "--output", "{{Param.OutputDir}}/{{Param.OutputName}}"]
    environment = {
        "name": "TetFlora",
        "description": "Separate Blender user folder for this session, with TetFlora installed from the job",
        "variables": {"BLENDER_USER_RESOURCES": "{{Session.WorkingDirectory}}/blender"},
        "script": {"actions": {"onEnter": {"command": "{{Param.Blender}}", "args": install}}},
    }
    step = {
        "name": STEP,
        "parameterSpace": {"taskParameterDefinitions": [frame]},
        "script": {"actions": {"onRun": {"command": "{{Param.Blender}}", "args": render}}},
    }
    return {
        "specificationVersion": "jobtemplate-2023-09",
        **({"extensions": ["TASK_CHUNKING"]} if chunked else {}),
        "name": job_name(job.name),
        "parameterDefinitions": _parameters(job),
        "jobEnvironments": [environment],
        "steps": [step],
    }


def _parameters(job: Job) -> list[dict[str, Any]]:
    scene: dict[str, Any] = {"name": "SceneFile", "type": "PATH", "objectType": "FILE", "dataFlow": "IN"}
    scene["description"] = "The .blend file"
    copied = []
    if job.scene is not None:
        # The default of a path is relative to the bundle; absolute ones are refused.
        scene["default"] = f"{SCENE_FOLDER}/{job.scene}"
        about = "The scene and the files that it uses; listed so that everything is transferred"
        copied.append(_folder("SceneFolder", SCENE_FOLDER, "IN", about))
    chunk = {"name": "ChunkSize", "type": "INT", "default": job.chunk, "minValue": 1}
    chunk["description"] = "Frames that a worker renders per task"
    return [
        scene,
        {"name": "Frames", "type": "STRING", "default": job.frames, "description": "For example 1-24, 7 or 1-99:2"},
        *([chunk] if job.chunk > 1 else []),
        _folder("OutputDir", OUTPUT_FOLDER, "OUT", "Folder of the images"),
        {
            "name": "OutputName",
            "type": "STRING",
            "default": job.picture_name,
            "description": "File name of the images; #### is the frame",
        },
        {"name": "Blender", "type": "STRING", "default": "blender", "description": "Command that starts Blender"},
        {
            "name": "CondaPackages",
            "type": "STRING",
            "default": "blender",
            "description": "Used by queues that install software with conda, ignored by others",
        },
        _folder("TetFloraFiles", FILES, "IN", "The extension, its installer, and your own species"),
        *copied,
    ]


def _folder(name: str, default: str, flow: str, about: str) -> dict[str, Any]:
    kind = {"name": name, "type": "PATH", "objectType": "DIRECTORY", "dataFlow": flow}
    return {**kind, "default": default, "description": about}


def parameter_values(scene: str | None) -> dict[str, Any]:
    """Values that the template has no default for: the .blend, if it stays where it is."""
    return {"parameterValues": [] if scene is None else [{"name": "SceneFile", "value": scene}]}


def asset_references(files: Sequence[str], folders: Sequence[str]) -> dict[str, Any]:
    """Files and folders outside of the bundle that Deadline Cloud's job attachments bring to the workers."""
    inputs = {"filenames": list(files), "directories": list(folders)}
    return {"assetReferences": {"inputs": inputs, "outputs": {"directories": []}, "referencedPaths": []}}
