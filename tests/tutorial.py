"""Tutorials as tests: the code blocks of a page, and its commands run as typed."""

import re

import pytest

from lab.cli import main


def blocks(page, language):
    """Code blocks of a page in one language."""
    return re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL)


def run(command):
    """Runs a command of the lab, which must succeed."""
    program, *words = command.split()
    assert program == "lab"
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 0, command
