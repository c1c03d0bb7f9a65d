"""Plants: each change makes another one."""

from dataclasses import replace

from lab.paths import Path
from lab.twin import twin
from tests.lab.effects.reference import nominal


def test_changes_of_a_path():
    plant = twin(nominal()).plant
    changed = plant.with_output(1, gain=2.0).with_input(0, gain=3.0)
    assert changed.output_paths == (Path(), Path(gain=2.0), Path(), Path(), Path())
    assert changed.input_paths == (Path(gain=3.0), Path())
    assert replace(changed, output_paths=plant.output_paths).output_paths == (Path(),) * 5
