"""Data sets 58 as bytes: pyuff reads them well, but writes a wrong byte count and leaves the file open.

Source: universal file data set 58, function at nodal degree of freedom: records 1 to 12, and 58b for binary data.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

TEXT_ROWS = {
    (False, True): ("%20.12e",) * 4,
    (False, False): ("%13.6e", "%20.12e") * 2,
    (True, True): ("%20.12e",) * 4,
    (True, False): ("%13.6e", "%20.12e", "%20.12e"),
}
"""Whether complex, whether even: format of a line of double precision."""

IEEE, LITTLE, HEADER_LINES = 2, 1, 11


def function_bytes(each: Mapping[str, Any]) -> bytes:
    """One data set 58 (text) or 58b (binary, little-endian) in double precision.

    Args:
        each: x and data, shape (n,), abscissa_spacing (1 when even), binary, and the fields of records 1 to 11.
    """
    data, x = np.asarray(each["data"]), np.asarray(each["x"], dtype=np.float64)
    even, complex_ = bool(each["abscissa_spacing"]), np.iscomplexobj(data)
    numbers = np.stack(
        [*([] if even else [x]), *([data.real, data.imag] if complex_ else [data])], axis=1
    ).ravel()
    body = numbers.astype("<f8").tobytes() if each["binary"] else _text(numbers, TEXT_ROWS[complex_, even])
    start, step = (x[0], x[1] - x[0]) if even else (0.0, 0.0)
    first = f"{58:6d}"
    if each["binary"]:
        first += f"b{LITTLE:6d}{IEEE:6d}{HEADER_LINES:12d}{len(body):12d}{0:6d}{0:6d}{0:12d}{0:12d}"
    lines = [
        f"{-1:6d}",
        first.ljust(80),
        *(f"{each[f'id{k}']:<80}" for k in range(1, 6)),
        f"{each['func_type']:5d}{0:10d}{0:5d}{0:10d} {_end(each, 'rsp')} {_end(each, 'ref')}",
        f"{6 if complex_ else 4:10d}{data.size:10d}{int(even):10d}{start:13.6e}{step:13.6e}{0:13.5e}",
        *(_axis(each, name) for name in ("abscissa", "ordinate", "orddenom", "z_axis")),
    ]
    head = ("\n".join(lines) + "\n").encode()
    return head + body + f"{-1:6d}\n".encode()


def _end(each: Mapping[str, Any], end: str) -> str:
    return f"{'NONE':<10}{each[f'{end}_node']:10d}{each[f'{end}_dir']:4d}"


def _axis(each: Mapping[str, Any], name: str) -> str:
    kind = each.get(f"{name}_spec_data_type", 0)
    label, unit = (each.get(f"{name}_{what}", "NONE") for what in ("axis_lab", "axis_units_lab"))
    return f"{kind:10d}{0:5d}{0:5d}{0:5d} {label:<20} {unit:<20}"


def _text(numbers: np.ndarray, row: tuple[str, ...]) -> bytes:
    whole = numbers.size // len(row)
    lines = whole * ("".join(row) + "\n") % tuple(numbers[: whole * len(row)])
    rest = numbers[whole * len(row) :]
    return (lines + ("".join(row[: rest.size]) + "\n") * bool(rest.size) % tuple(rest)).encode()
