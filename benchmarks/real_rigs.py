"""What the lab says of published rigs, beside what is known of them: the table of docs/real-rigs.md.

    python benchmarks/real_rigs.py [--only RIG] [--print]

RIG is one of ecp, silverbox, friction_damper, beam, towers. The recordings are not part of the project: they lie in
../shared/data, one folder per rig, as examples/rigs/README.md says where they come from. Rows of rigs left out stay as they
are.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.rigs.row import DATA, Row  # noqa: E402

RIGS = ("ecp", "silverbox", "friction_damper", "beam", "towers")
PAGE = ROOT / "docs" / "real-rigs.md"
HEAD = (
    "| Rig | Question | Known | The lab says | Parameter | On data kept aside | Wrong or undecided, and why |\n"
    "|---|---|---|---|---|---|---|"
)


def rows_of(rig: str) -> list[Row]:
    """All rows of a rig, told as they come."""
    found = []
    for row in importlib.import_module(f"benchmarks.rigs.{rig}").rows():
        print(row.markdown(), flush=True)
        found.append(row)
    return found


def write(rig: str, rows: list[Row]) -> None:
    """Puts the rows of a rig between its marks in the page."""
    begin, end = f"<!-- {rig} -->", f"<!-- end {rig} -->"
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(begin)
    _, _, after = rest.partition(end)
    if not rest or not after:
        sys.exit(f"{PAGE.name} lacks the marks {begin} and {end}; put them where the rows belong")
    table = "\n".join([HEAD, *(row.markdown() for row in rows)])
    PAGE.write_text(f"{before}{begin}\n{table}\n{end}{after}", encoding="utf-8")


def main() -> None:
    """The table, rig by rig."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=RIGS, action="append", help="this rig; may come again")
    parser.add_argument("--print", action="store_true", help="leave the page as it is")
    arguments = parser.parse_args()
    if not DATA.is_dir():
        sys.exit(f"the recordings are not there; expected them in {DATA}")
    for rig in arguments.only or RIGS:
        rows = rows_of(rig)
        if not arguments.print:
            write(rig, rows)


if __name__ == "__main__":
    main()
