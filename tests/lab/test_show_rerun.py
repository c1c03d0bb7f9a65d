"""Rerun files read back without a viewer: what is in them, and that every view looks at something that exists."""

import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.compute
import pytest
from rerun.chunk import RrdReader

from identification.recording import Channel, Record, Recording
from lab.rig import Rig
from lab.shapes import dof_shapes
from lab.show import structure
from lab.show.rerun_log import write_rrd
from lab.show.rerun_log.matrices import scaled
from lab.show.rerun_log.spectra import level_range
from lab.show.signals import spectra, upper_frequency
from tests.lab.showcase import RATE, chain_result, chain_rig, motion_of, pulse_recording, random_recording
from tests.lab.test_show_structure import MIXED


class Read:
    """An .rrd file: entities, columns over a timeline, static values, views of its blueprint."""

    def __init__(self, path):
        self.reader = RrdReader(str(path))
        (self.recording,), (self.blueprint,) = self.reader.recordings(), self.reader.blueprints()
        self.entities = set(self.reader.store(store=self.recording).schema().entity_paths())

    def chunks(self, entity, component):
        stream = self.reader.stream(store=self.recording).filter(content=entity, components=[component])
        return [chunk for chunk in stream if chunk.entity_path == entity]

    def series(self, entity, component, timeline="sim_time"):
        """Times [s] or numbers, and rows of values."""
        times, values = [], []
        for chunk in self.chunks(entity, component):
            if chunk.is_static or timeline not in chunk.timeline_names:
                continue
            batch = chunk.to_record_batch()
            times.append(batch.column(timeline).cast(pa.int64()).to_numpy())
            values += batch.column(component).to_pylist()
        order = np.argsort(np.concatenate(times), kind="stable")
        return np.concatenate(times)[order], np.array(values, dtype=float)[order]

    def static(self, entity, component):
        (chunk,) = self.chunks(entity, component)
        assert chunk.is_static
        return chunk.to_record_batch().column(component)[0].as_py()

    def views(self):
        """Class and origin of every view."""
        found = {}
        for chunk in self.reader.stream(store=self.blueprint):
            batch = chunk.to_record_batch()
            for name in ("ViewBlueprint:class_identifier", "ViewBlueprint:space_origin"):
                if name in batch.schema.names:
                    found.setdefault(chunk.entity_path, {})[name.split(":")[1]] = batch.column(name)[
                        0
                    ].as_py()[0]
        return [(view["class_identifier"], view["space_origin"]) for view in found.values()]


@pytest.fixture(scope="module")
def rig():
    return chain_rig("chain3_coupled", inputs=["force1", "force2"], outputs=["acc2.x", "acc3.x", "pos1"])


@pytest.fixture(scope="module")
def recording(rig):
    return pulse_recording(rig)


@pytest.fixture(scope="module")
def motion(rig, recording):
    return motion_of(rig, recording)


@pytest.fixture(scope="module")
def read(rig, recording, motion, tmp_path_factory):
    path = tmp_path_factory.mktemp("rrd") / "run.rrd"
    write_rrd(path, chain_result(rig), recording, rig=rig, motion=motion)
    return Read(path)


def test_every_view_looks_at_an_entity(read):
    views = read.views()
    missing = [origin for _, origin in views if origin not in read.entities]
    assert missing == []
    kinds = [kind for kind, _ in views]
    assert {kind: kinds.count(kind) for kind in set(kinds)} == {
        "3D": 1 + 3,  # the test and three modes
        "TimeSeries": 3,  # forces, accelerations, displacements
        "TextDocument": 1,
        "2D": 9 + 2 + 1 + 2,  # M, C, K three ways; MAC twice; stabilization diagram; spectra of two units
    }
    assert read.blueprint.application_id == read.recording.application_id


def test_channels_come_back_one_record_after_the_other(read, recording):
    nanoseconds, values = read.series("/test/outputs/acceleration_m_s_2", "Scalars:scalars")
    gap = np.isnan(values).all(axis=1)
    assert gap.sum() == 1  # between two records
    expected = np.concatenate([record.outputs[:2] for record in recording.records], axis=1)
    np.testing.assert_array_equal(values[~gap].T, expected)
    np.testing.assert_allclose(nanoseconds[~gap] / 1e9, np.arange(1200) * recording.dt, atol=1e-9)
    assert read.static("/test/outputs/acceleration_m_s_2", "SeriesLines:names") == ["acc2.x", "acc3.x"]


def test_spectra_and_coherence_are_curves_in_decibels(rig, tmp_path):
    """Without noise the inputs explain all but leakage; levels are 10 log10 of the density, cut at the frame."""
    recording = random_recording(rig)
    write_rrd(tmp_path / "run.rrd", chain_result(rig), recording)
    read = Read(tmp_path / "run.rrd")
    assert {"/test/spectra/acceleration_m_s_2", "/test/spectra/displacement_m", "/test/coherence"} <= {
        origin for _, origin in read.views()
    }
    (line,) = read.static("/test/coherence/curves/0", "LineStrips2D:strips")
    height = np.array(line)[:, 1]
    assert 0 <= np.median(height) < 0.02 * 80  # the frame is 80 high, coherence 1 at its top
    assert read.static("/test/coherence/legend/2", "Points2D:labels") == ["pos1"]
    spectrum = spectra(recording)
    shown = (spectrum.frequency_hz > 0) & (
        spectrum.frequency_hz <= upper_frequency(RATE, chain_result(rig).modes.frequency_hz)
    )
    levels = 10 * np.log10(spectrum.output_density[:2, shown])
    low, high = level_range([levels])
    (line,) = read.static("/test/spectra/acceleration_m_s_2/curves/1", "LineStrips2D:strips")
    drawn = high - np.array(line)[:, 1] / 80 * (high - low)
    np.testing.assert_allclose(drawn, np.clip(levels[1], low, high), atol=1e-4)  # single precision of 100 dB
    assert low <= levels.min() or high - low == 100


def test_bodies_move_as_the_structure_did(read, rig, motion):
    _, drawn = read.series("/test/structure/bodies/mass1", "Transform3D:translation")
    factor = structure.magnification(rig, motion.position)
    x = drawn[:, 0, 0] - rig.model.body("mass1").pos[0]
    every = round((motion.time.size - 1) / (x.size - 1))
    expected = factor * motion.position[0, ::every][: x.size]
    np.testing.assert_allclose(x, expected, atol=1e-6)  # drawn in single precision


def test_springs_are_red_in_tension_and_blue_in_compression(read, rig, motion):
    nanoseconds, paths = read.series("/test/structure/springs/spring1_3", "LineStrips3D:strips")
    assert paths.shape[1:] == (1, 2, 3)
    _, colors = read.series("/test/structure/springs/spring1_3", "LineStrips3D:colors")
    red, blue = (colors[:, 0].astype(np.uint32) >> 24) & 255, (colors[:, 0].astype(np.uint32) >> 8) & 255
    at = np.round(nanoseconds / 1e9 / motion.time[1]).astype(int)
    row = [spring.name for spring in rig.springs].index("spring1_3")
    extension = rig.extensions(motion.position[:, at])[row]
    strong = np.abs(extension) > 0.05 * np.abs(extension).max()
    assert np.all((red > blue)[strong] == (extension > 0)[strong])


def test_forces_are_arrows_along_their_axis(read):
    _, vectors = read.series("/test/structure/forces/force1", "Arrows3D:vectors")
    lengths = np.linalg.norm(vectors[:, 0], axis=1)
    assert lengths[0] > 0.5  # the pulse
    assert np.all(lengths[1:] == 0)
    np.testing.assert_array_equal(vectors[0, 0, 1:], 0)


def test_modes_swing_through_one_loop(read, rig):
    degrees, places = read.series("/modes/mode2/bodies/mass3", "Transform3D:translation", "phase_deg")
    assert degrees.tolist() == list(range(0, 360, 15))
    shape = dof_shapes(chain_result(rig), rig.dofs)[0][:, 1]
    x = places[:, 0, 0] - rig.model.body("mass3").pos[0]
    wave = np.real(shape[2] * np.exp(1j * np.radians(degrees)))
    np.testing.assert_allclose(x / np.abs(x).max(), wave / np.abs(wave).max(), atol=1e-5)  # single precision
    again, _ = read.series("/modes/mode2/bodies/mass3", "Transform3D:translation")
    assert again.size % 24 == 0  # and over and over while the test runs


def test_matrices_carry_their_numbers(read, rig):
    labels = read.static("/matrices/stiffness/true/numbers", "Points2D:labels")
    assert labels == [f"{v + 0.0:.3f}" for v in rig.second_order().stiffness.ravel()]
    names = read.static("/matrices/stiffness/true/names", "Points2D:labels")
    assert names == [*rig.dofs, *rig.dofs]
    assert len(read.static("/mac/truth/numbers", "Points2D:labels")) == 9


def test_stabilization_shows_every_pole_once(read, rig):
    label = chain_result(rig).stabilization.label
    for name in set(label):
        entity = "stable" if name == "stable" else "rejected/" + name.replace(" ", "\\ ")
        highest = read.static("/modes/stabilization/ticks", "Points2D:labels")
        assert highest
        points = read.static(f"/modes/stabilization/{entity}", "Points2D:positions")
        texts = [
            read.static(e, "Points2D:labels")[0]
            for e in read.entities
            if e.startswith("/modes/stabilization/legend/")
        ]
        assert f"{name} ({label.count(name)})" in texts
        assert len(points) <= label.count(name)


def test_without_a_structure_the_shapes_are_plotted(rig, recording, tmp_path):
    write_rrd(tmp_path / "run.rrd", chain_result(rig), recording)
    read = Read(tmp_path / "run.rrd")
    views = read.views()
    assert not [kind for kind, _ in views if kind == "3D"]
    assert all(origin in read.entities for _, origin in views)
    stems = read.static("/modes/mode1/real", "Points2D:positions")
    assert len(stems) == 3


def test_hostile_names_and_poor_results(tmp_path):
    """Names that are no path parts; no input, no mode, no matrix; nothing fails and nothing warns."""
    rig = Rig.from_xml(MIXED.replace('"bob"', '"a/b !|#*`é"').replace('"slip"', '"s/../p"'))
    motion_rows = 0.1 * np.random.default_rng(0).standard_normal((3, 50))
    outputs = (Channel("</a> *b* ", "V"), Channel("x/y", "m", "x"))
    recording = Recording(
        (Record("ambient", np.zeros((0, 50)), np.ones((2, 50))),), (), outputs, 10.0, title="#"
    )
    result = chain_result(
        chain_rig("chain3_coupled", inputs=["force1"], outputs=["acc1.x"]), title="| # <b>/"
    )
    bare = replace(
        result,
        modes=replace(result.modes.take([False] * 3)),
        stable=(),
        second_order=None,
        stabilization=None,
        truth_modes=None,
        truth_second_order=None,
        comparison=None,
        criteria=(),
    )
    moved = type(motion_of(chain_rig("chain3_coupled"), pulse_recording(chain_rig("chain3_coupled"), 3)))
    motion = moved(np.arange(50) / 10.0, motion_rows, np.zeros((0, 50)))
    write_rrd(tmp_path / "run.rrd", bare, recording, rig=rig, motion=motion)
    read = Read(tmp_path / "run.rrd")
    assert all(origin in read.entities for _, origin in read.views())


@pytest.mark.parametrize(
    ("matrix", "numbers", "scale"),
    [
        (np.array([[27071.0, -3535.5]]), ["27.07", "-3.54"], "1e3 "),
        (np.array([[2.0, -1e-9]]), ["2.000", "0.000"], ""),
        (np.array([[3e-13, -1e-13]]), ["300.0", "-100.0"], "1e-15 "),
        (np.zeros((1, 2)), ["0", "0"], ""),
    ],
)
def test_matrix_numbers_are_short(matrix, numbers, scale):
    assert scaled(matrix, float(np.abs(matrix).max()), digits=4, step=3) == (numbers, scale)


def test_long_records_become_envelopes_quickly(rig, tmp_path):
    """A million samples of thirty channels in at most five seconds, peaks kept."""
    y = np.random.default_rng(0).standard_normal((30, 1_000_000))
    y[7, 123_456] = 40.0
    channels = tuple(Channel(f"y{i}", "m/s^2") for i in range(30))
    recording = Recording((Record("ambient", np.zeros((0, 0)), y),), (), channels, 1000.0)
    result = chain_result(rig)
    before = time.process_time()
    write_rrd(tmp_path / "run.rrd", result, recording)
    assert time.process_time() - before < 5.0
    _, values = Read(tmp_path / "run.rrd").series("/test/outputs/acceleration_m_s_2", "Scalars:scalars")
    assert values.shape[0] <= 4000
    assert np.max(values[:, 7]) == 40.0


def test_importing_the_lab_draws_nothing():
    code = "import sys, lab, lab.show; print(sorted({'rerun', 'matplotlib', 'jinja2'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
