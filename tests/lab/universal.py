"""A tiny reader and writer of universal files, made from the published record layouts and nothing else."""

import struct

import numpy as np


def function(data, x, **about):
    """Text (or bytes, with binary="<" or ">") of a data set 58."""
    about = {
        "kind": 1,
        "node": 1,
        "direction": 3,
        "ref_node": 0,
        "ref_direction": 0,
        "type": 12,
        "label": "m/s^2",
        "below_type": 0,
        "below_label": "NONE",
        "x_type": 17,
        "entity": "NONE",
        "binary": "",
        "double": True,
        "even": True,
        "ids": ("NONE",) * 5,
        "n": None,
    } | about
    data, x = np.asarray(data), np.asarray(x)
    form = {(0, 0): 2, (0, 1): 4, (1, 0): 5, (1, 1): 6}[np.iscomplexobj(data), about["double"]]
    n = data.size if about["n"] is None else about["n"]
    step = x[1] - x[0]
    start, step = (x[0], step) if about["even"] else (0.0, 0.0)
    parts = [data.real, data.imag] if np.iscomplexobj(data) else [data]
    numbers = np.stack(parts if about["even"] else [x, *parts], axis=1)  # (n, values per point)
    size = (8 if about["double"] else 4) * numbers.size
    order = 1 if about["binary"] == "<" else 2
    first = (
        f"    58b{order:6d}{2:6d}{11:12d}{size:12d}{0:6d}{0:6d}{0:12d}{0:12d}"
        if about["binary"]
        else "    58"
    )
    lines = [
        "    -1",
        first,
        *about["ids"],
        f"{about['kind']:5d}{0:10d}{0:5d}{0:10d} {about['entity']:<10}{about['node']:10d}{about['direction']:4d}"
        f" {'NONE':<10}{about['ref_node']:10d}{about['ref_direction']:4d}",
        f"{form:10d}{n:10d}{int(about['even']):10d}{start:13.5e}{step:13.5e}{0:13.5e}",
        f"{about['x_type']:10d}{0:5d}{0:5d}{0:5d} {'axis':<20} {'unit':<20}",
        f"{about['type']:10d}{0:5d}{0:5d}{0:5d} {'value':<20} {about['label']:<20}",
        f"{about['below_type']:10d}{0:5d}{0:5d}{0:5d} {'NONE':<20} {about['below_label']:<20}",
        f"{0:10d}{0:5d}{0:5d}{0:5d} {'NONE':<20} {'NONE':<20}",
    ]
    head = ("\n".join(lines) + "\n").encode()
    if about["binary"]:
        letter = "d" if about["double"] else "f"
        body = struct.pack(f"{about['binary']}{numbers.size}{letter}", *numbers.ravel())
    else:
        body = _text(numbers, about["even"], about["double"], np.iscomplexobj(data)).encode()
    return head + body + b"    -1\n"


def _text(numbers, even, double, complex_):
    """Numbers in the columns of record 12, by its table of formats."""
    if not double:
        widths = [13] * 6
    elif even:
        widths = [20] * 4
    else:
        widths = [13, 20, 20] if complex_ else [13, 20, 13, 20]
    text = ""
    for k, value in enumerate(numbers.ravel()):
        width = widths[k % len(widths)]
        text += f"{value:{width}.{5 if width == 13 else 11}e}"
        text += "\n" if k % len(widths) == len(widths) - 1 else ""
    return text if text.endswith("\n") else text + "\n"


def units(length, force, code=9):
    """Data set 164."""
    row = "".join(f"{value:25.16e}" for value in (length, force, 1.0)).replace("e", "D")
    return f"    -1\n   164\n{code:10d}{'made by hand':<20}{1:10d}\n{row}\n{0.0:25.16e}\n    -1\n".encode()


def nodes(places):
    """Data set 15."""
    rows = "".join(
        f"{n:10d}{0:10d}{0:10d}{8:10d}{x:13.5e}{y:13.5e}{z:13.5e}\n" for n, (x, y, z) in places.items()
    )
    return f"    -1\n    15\n{rows}    -1\n".encode()


def trace(sequence):
    """Data set 82."""
    rows = "".join(f"{n:10d}" for n in sequence)
    return f"    -1\n    82\n{1:10d}{len(sequence):10d}{0:10d}\nNONE\n{rows}\n    -1\n".encode()


def mode(number, shapes, *, kind=12, pole=None, frequency=0.0, damping=0.0):
    """Data set 55 of a complex (with pole) or normal mode; shapes are three numbers by node."""
    if pole is None:
        what, numbers = f"{2:10d}{4:10d}", [frequency, 1.0, damping, 0.0]
    else:
        what, numbers = f"{2:10d}{6:10d}", [pole.real, pole.imag, 0.0, 0.0, 0.0, 0.0]
    complex_ = pole is not None
    text = "    -1\n    55\n" + "NONE\n" * 5
    text += "".join(f"{k:10d}" for k in (1, 3 if complex_ else 2, 2, kind, 5 if complex_ else 2, 3)) + "\n"
    text += f"{what}{0:10d}{number:10d}\n" + "".join(f"{value:13.5e}" for value in numbers) + "\n"
    for node, values in shapes.items():
        parts = [part for v in values for part in ((v.real, v.imag) if complex_ else (v.real,))]
        text += f"{node:10d}\n" + "".join(f"{part:13.5e}" for part in parts) + "\n"
    return (text + "    -1\n").encode()


def read(path):
    """Data sets of a file by type: lists of small dicts, for the layouts that the lab writes."""
    raw = path.read_bytes()
    found = {}
    at = 0
    while at < len(raw):
        assert raw[at : at + 7] == b"    -1\n", raw[at : at + 20]
        line = raw[at + 7 : raw.index(b"\n", at + 7)].decode()
        body = at + 7 + len(line) + 1
        if line.startswith("    58b"):
            lines = raw[body:].split(b"\n", 11)
            data = body + sum(len(each) + 1 for each in lines[:11])
            n_bytes = int(line[31:43])
            each = _header([text.decode() for text in lines[:11]])
            each["values"] = np.frombuffer(
                raw[data : data + n_bytes], "<f8" if int(line[7:13]) == 1 else ">f8"
            )
            end = data + n_bytes
            kind = 58
        else:
            end = raw.index(b"    -1\n", body)
            lines = raw[body:end].decode().splitlines()
            kind = int(line)
            each = {58: _function, 15: _nodes, 55: _mode}.get(kind, lambda lines: {"lines": lines})(lines)
        assert raw[end : end + 7] == b"    -1\n"
        found.setdefault(kind, []).append(each)
        at = end + 7
    return found


def _header(lines):
    r6, r7 = lines[5], lines[6]
    axis = {"x": lines[7], "y": lines[8], "d": lines[9]}
    return {
        "ids": [text.strip() for text in lines[:5]],
        "kind": int(r6[:5]),
        "node": int(r6[41:51]),
        "direction": int(r6[51:55]),
        "ref_node": int(r6[66:76]),
        "ref_direction": int(r6[76:80]),
        "form": int(r7[:10]),
        "n": int(r7[10:20]),
        "even": int(r7[20:30]) == 1,
        "start": float(r7[30:43]),
        "step": float(r7[43:56]),
        **{f"{name}_type": int(text[:10]) for name, text in axis.items()},
        **{f"{name}_label": text[47:67].strip() for name, text in axis.items()},
    }


def _function(lines):
    each = _header(lines)
    each["values"] = np.array([float(text) for line in lines[11:] for text in line.split()])
    return each


def _nodes(lines):
    return {int(line[:10]): tuple(float(line[k : k + 13]) for k in (40, 53, 66)) for line in lines}


def _mode(lines):
    about = [int(lines[5][k : k + 10]) for k in range(0, 60, 10)]
    numbers = [float(lines[7][k : k + 13]) for k in range(0, 78, 13)]
    shape = {}
    for head, row in zip(lines[8::2], lines[9::2], strict=True):
        v = [float(row[k : k + 13]) for k in range(0, 78, 13)]
        shape[int(head)] = np.array([complex(*v[k : k + 2]) for k in (0, 2, 4)])
    return {"about": about, "pole": complex(*numbers[:2]), "shape": shape}
