# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of a job for a render farm (Open Job Description, jobtemplate-2023-09).

Source: Open Job Description, "Template Schemas 2023-09" and its extension TASK_CHUNKING
(github.com/OpenJobDescription/openjd-specifications). The two files beside the template are those of a job bundle of
AWS Deadline Cloud. All are JSON, which the specification allows; Blender's Python cannot write YAML.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from .extension import Run, SceneError, frame_numbers

#: Folder of the bundle with everything that a worker needs besides Blender and the scene.
FILES = "tetflora"
#: Script in it that installs the extension.
INSTALLER = "install_tetflora.py"
#: Folder of the bundle with copies of the scene and its assets.
SCENE_FOLDER = "scene"
OUTPUT_FOLDER = "output"
STEP = "Render"

_LONGEST_NAME = 128


@dataclass(frozen=True)
class Job:
    """Values of a job's template.

    Attributes
    ----------
    name : str
        Shown by the scheduler.
    frames : str
        Range expression, see `frame_runs`.
    chunk : int
        Frames that a worker renders per task.
    image_name : str
        File name of the images; ``####`` is the frame.
    scene : str or None
        The .blend within the bundle, relative and with slashes; None if it stays where it is.
    """

    name: str
    frames: str
    chunk: int
    image_name: str
    scene: str | None


def frame_expression(runs: Sequence[Run]) -> str:
    """The opposite of `frame_runs`: the shortest expression of each run.

    Raises
    ------
    SceneError
        There is no frame, or one is in two runs, which OpenJD does not allow.
    """
    numbers = frame_numbers(runs)
    if not numbers:
        raise SceneError("No frames to render; raise the End frame of the scene, or use --frames")
    seen: set[int] = set()
    twice = next((n for n in numbers if n in seen or seen.add(n)), None)
    if twice is not None:
        raise SceneError(f"Frame {twice} occurs twice in --frames; list each frame once")
    runs = [(first, last - (last - first) % step, step) for first, last, step in runs if last >= first]
    return ",".join(
        str(first) if first == last else f"{first}-{last}" + (f":{step}" if step > 1 else "")
        for first, last, step in runs
    )


def job_name(stem: str) -> str:
    """A valid name: without double braces, which are variables, and control characters, which are invalid."""
    text = re.sub(r"\{\{|\}\}|[\x00-\x1f\x7f-\x9f]", " ", stem).strip()
    return f"{text or 'scene'} (TetFlora)"[:_LONGEST_NAME]


def template(job: Job) -> dict[str, Any]:
    """The job template.

    Its environment gives Blender a folder of resources inside the session and installs the extension there: the
    worker's own add-ons and preferences are neither read nor changed. Each task is one Blender. Only chunks need the
    extension TASK_CHUNKING of the specification.
    """
    chunked = job.chunk > 1
    frame: dict[str, Any] = {"name": "Frame", "type": "INT", "range": "{{Param.Frames}}"}
    if chunked:
        frame["type"] = "CHUNK[INT]"
        # Contiguous chunks would be single frames where the range has a step or gaps.
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
        # The default of a path is relative to the bundle; absolute ones are invalid.
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
            "default": job.image_name,
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
    """Values without a default in the template: the .blend, if it is not copied."""
    return {"parameterValues": [] if scene is None else [{"name": "SceneFile", "value": scene}]}


def asset_references(files: Sequence[str]) -> dict[str, Any]:
    """Files outside of the bundle that Deadline Cloud transfers to the workers."""
    inputs = {"filenames": list(files), "directories": []}
    return {"assetReferences": {"inputs": inputs, "outputs": {"directories": []}, "referencedPaths": []}}
