"""Every public function says what it takes, gives and refuses, and which equation it implements."""

import ast
import inspect
import re
from pathlib import Path

import pytest

import identification

FOLDER = Path(identification.__file__).parent

CHOICES = """
all_lines around_the_order brief_warnings choose_method choose_orders choose_segments default_degree explanation
family find_method find_peaks find_period first_settled gathered hankel_size leading_subspace matrix_model named_rows
numerical_rank orders_within_rank output_error plan_hankel planned predict repeat require_channels resonance_band
response_rank settle_orders shows_rank simulated start_values told_shift values_near
"""
"""Choices, checks, words, and the plumbing between methods."""

REARRANGED = """
channel_matrices cluster_means free_matrices frozen in_three_parts join modal_parameters passive
reference_rows spring_network transforms widths without_part
"""
"""Arrays put in another form."""

ALGEBRA = """
balance close_pairs cluster_scatter excited least_squares line_weight line_weights modal_gains modal_outputs
modal_states model_points noise_model oscillating recursion rms simulate solve_linear spectrum triangular unit_sizes
"""
"""A line of algebra that the first line of the docstring is."""

NO_EQUATION = set(f"{CHOICES} {REARRANGED} {ALGEBRA}".split())


def public(kind):
    """Definitions of a kind on the first level of every module, by module and name."""
    return [
        pytest.param(node, id=f"{path.stem}.{node.name}")
        for path in sorted(FOLDER.glob("*.py"))
        for node in ast.parse(path.read_text()).body
        if isinstance(node, kind) and not node.name.startswith("_")
    ]


def parts(node):
    """Headings of a docstring and the text below each; the first line has none."""
    found, heading = {"": ""}, ""
    for line in inspect.cleandoc(ast.get_docstring(node) or "").splitlines():
        word = line.split(":")[0]
        if word in ("Args", "Returns", "Yields", "Raises", "Source", "Attributes"):
            heading, line = word, line.partition(":")[2]
        found[heading] = f"{found.get(heading, '')}\n{line}"
    return found


def raises(node):
    """Whether the function itself raises something of its own."""
    return any(isinstance(inner, ast.Raise) and inner.exc is not None for inner in ast.walk(node))


@pytest.mark.parametrize("node", public(ast.FunctionDef))
def test_a_function_says_what_it_takes_gives_and_refuses(node):
    said = parts(node)
    assert said[""].strip()
    names = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
    missing = [name for name in names if name not in said.get("Args", "")]
    assert not missing, f"Args of {node.name} do not tell {', '.join(missing)}"
    gives = node.returns is not None and ast.unparse(node.returns) != "None"
    assert not gives or "Returns" in said or "Yields" in said
    assert not raises(node) or "Raises" in said
    source = said.get("Source", "").strip()
    assert bool(source) != (node.name in NO_EQUATION)


@pytest.mark.parametrize("node", public(ast.ClassDef))
def test_a_class_says_what_it_is_and_so_do_its_methods(node):
    assert parts(node)[""].strip()
    for method in node.body:
        if isinstance(method, ast.FunctionDef) and not method.name.startswith("_"):
            said = parts(method)
            assert said[""].strip(), f"{node.name}.{method.name} has no docstring"
            assert not raises(method) or "Raises" in said, f"{node.name}.{method.name} has no Raises"


@pytest.mark.parametrize(
    "name", [n for n in identification.__all__ if inspect.isfunction(getattr(identification, n))]
)
def test_the_source_of_what_is_offered_names_its_equation(name):
    source = inspect.getdoc(getattr(identification, name)).partition("Source:")[2]
    # By number, or in symbols; a chain of sources ends in one.
    assert re.search(r"eqs?\. \(|section|ch\. |=|Σ|Δ|φ|as for `", source), source


def test_no_exception_is_outdated():
    assert set(NO_EQUATION) <= {each.values[0].name for each in public(ast.FunctionDef)}
