"""A study whose runs take a few hundredths of a second, and executors that tests can follow."""

import json
import threading
from concurrent.futures import Executor, Future

from lab.studies import journal
from lab.studies.conduct import study
from lab.studies.plan import load_study

SCENARIO = """
title = "Three masses, one force, one accelerometer"
model = "chain3_uncoupled.xml"

[test]
sample_rate = 20.0
duration = 5.0
accuracy = 1e-4

[excitation]
kind = "pulse"

[channels]
inputs = ["force1"]
outputs = ["acc2.x"]

[instruments]
noise_percent = 1.0

[identification]
method = "era"
order = 6
"""
STUDY = """
title = "A small study"
scenario = "small.toml"
seed = 7
repeats = 3

[vary]
instruments.noise_percent = [1.0, 2.0]
identification.order = [6, 8]

[collect]
f1 = "result.modes.0.frequency_hz"
"""


def written(folder, text=STUDY, scenario=SCENARIO):
    """The study file, with its scenario beside it."""
    folder.mkdir(exist_ok=True)
    (folder / "small.toml").write_text(scenario, encoding="utf-8")
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


def loaded(folder, text=STUDY, scenario=SCENARIO):
    return load_study(written(folder, text, scenario))


class Here(Executor):
    """Does everything at once in this process."""

    def submit(self, function, /, *arguments):
        future = Future()
        try:
            future.set_result(function(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future


class Following(Executor):
    """Calls `each(arguments)` in another thread, and remembers how many calls were ever open at once."""

    def __init__(self, each):
        self.each, self.open, self.most, self.lock = each, 0, 0, threading.Lock()

    def submit(self, function, /, *arguments):
        future = Future()
        with self.lock:
            self.open += 1
            self.most = max(self.most, self.open)

        def go():
            try:
                value = self.each(*arguments)
            except Exception as error:
                self.close()
                future.set_exception(error)
            else:
                self.close()
                future.set_result(value)

        threading.Thread(target=go).start()
        return future

    def close(self):
        with self.lock:
            self.open -= 1


def conducted(path, out, **options):
    return study(path, out, executor=Here(), **options)


def rows(out):
    """What the journal says of each run, without how long it took."""
    return {
        each["run"]: json.dumps({key: value for key, value in each.items() if key != "seconds"})
        for each in journal.outcomes(out / journal.NAME)
    }
