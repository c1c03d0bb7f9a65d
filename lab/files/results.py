"""Result -> result.json, plain enough for any language to read."""

from __future__ import annotations

import json
import math
import os
import uuid
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from identification.likelihood import Estimate
from identification.modes import Modes
from identification.recording import Array
from identification.systems import SecondOrder
from lab.errors import FileError
from lab.result import Result

FORMAT = "modal-result"
VERSION = 1


def result_document(result: Result) -> dict[str, Any]:
    """What `result.json` says, as plain lists, numbers and texts; None for a number that is not finite."""
    truth = None
    if result.truth_modes is not None:
        truth = {
            "modes": _modes(result.truth_modes),
            "second_order": _second_order(result.truth_second_order),
        }
    document = {
        "format": FORMAT,
        "version": VERSION,
        "title": result.title,
        "method": result.realization.method,
        "order": result.realization.order,
        "settings": result.realization.settings,
        "sample_rate": result.sample_rate,
        "modes": [
            {**mode, "stable": bool(stable)}
            for mode, stable in zip(_modes(result.modes), result.stable, strict=True)
        ],
        "second_order": _second_order(result.second_order),
        "truth": truth,
        "comparison": None if result.comparison is None else asdict(result.comparison),
        "criteria": [asdict(criterion) for criterion in result.criteria],
        "validation": [asdict(each) for each in result.validation],
        "warnings": list(result.warnings),
        "notes": list(result.notes),
        "explanation": result.explanation,
        "refinement": _refinement(result.refinement),
    }
    return dict(_plain(document))


def save_result(result: Result, path: str | Path) -> None:
    """Write `result.json`; an existing file is replaced once the new one is whole.

    Raises:
        FileError: the file cannot be written.
    """
    path = Path(path)
    hidden = path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}.part")
    try:
        hidden.write_text(result_text(result) + "\n", encoding="utf-8")
        os.replace(hidden, path)
    except OSError as error:
        hidden.unlink(missing_ok=True)
        raise FileError(f"{path}: cannot be written ({error.strerror})") from None


def result_text(result: Result) -> str:
    """The text of `result.json`."""
    return json.dumps(result_document(result), indent=1, ensure_ascii=False, allow_nan=False)


def load_result(path: str | Path) -> dict[str, Any]:
    """The document in a `result.json`, checked for format and version.

    Raises:
        FileError: no such file, not JSON, or of another format or version.
    """
    path = Path(path)
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise FileError(f"{path}: is not JSON ({error}); expected a result.json of the lab") from None
    form = document.get("format") if isinstance(document, dict) else None
    if form != FORMAT or document.get("version") != VERSION:
        raise FileError(f"{path}: format is {form!r}; expected {FORMAT!r} version {VERSION}")
    return dict(document)


def _modes(modes: Modes) -> list[dict[str, Any]]:
    nothing = [None] * len(modes)
    frequency_std = nothing if modes.frequency_std is None else modes.frequency_std
    damping_std = nothing if modes.damping_std is None else modes.damping_std
    return [
        {
            "frequency_hz": modes.frequency_hz[k],
            "frequency_std": frequency_std[k],
            "damping_ratio": modes.damping_ratio[k],
            "damping_std": damping_std[k],
            "shape": {
                channel.name: [value.real, value.imag]
                for channel, value in zip(modes.outputs, modes.shapes[:, k], strict=True)
            },
        }
        for k in range(len(modes))
    ]


def _second_order(matrices: SecondOrder | None) -> dict[str, Any] | None:
    if matrices is None:
        return None
    names = ("mass", "damping", "stiffness", "mass_std", "damping_std", "stiffness_std")
    return {"dofs": list(matrices.dofs)} | {name: _rows(getattr(matrices, name)) for name in names}


def _refinement(estimate: Estimate | None) -> dict[str, Any] | None:
    """How the maximum of the likelihood was reached, and the noise found at it, by output channel."""
    if estimate is None:
        return None
    outputs = [channel.name for channel in estimate.modes.outputs]
    return {
        "parameters": len(estimate.names),
        "log_likelihood": estimate.log_likelihood,
        "iterations": estimate.n_iterations,
        "converged": estimate.converged,
        "noise_std": dict(zip(outputs, estimate.noise_std.T.tolist(), strict=True)),
        "whiteness": dict(zip(outputs, estimate.whiteness.tolist(), strict=True)),
    }


def _rows(matrix: Array | None) -> list[list[float]] | None:
    return None if matrix is None else matrix.tolist()


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.integer | np.bool_):
        return value.item()
    return value
