"""Signals, and input that means harm: what the program promises of them (docs/reliability.md).

    test_hostile.py PATH/TO/oted [TestClass.test_name ...]
"""

import gzip
import io
import os
import resource
import select
import signal
import subprocess
import time
import unittest
import zipfile

import numpy as np

import program
from program import DATA_OR_MODEL, INTERRUPTED, USAGE, ProgramTest, oted

GIB = 1 << 30


def peak_memory(*arguments):
    """The result of a command, and the largest resident set of it [bytes]."""
    child = subprocess.Popen([program.OTED, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    with child.stdout, child.stderr:
        out, err = child.stdout.read(), child.stderr.read()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    return subprocess.CompletedProcess(child.args, child.returncode, out, err), usage.ru_maxrss * 1024


class TestSignals(ProgramTest):
    MODEL = """<mujoco><option timestep="{step}"/><worldbody><body><joint name="a" axis="0 1 0"/><geom size="0.1"/></body>
      </worldbody><actuator><motor joint="a" ctrlrange="-1 1"/></actuator></mujoco>"""
    TASK = """[task]
model = "m.xml"
control_period = 0.02
observations = ["joint/*/qpos", "joint/*/qvel"]
[data]
path = "logs.csv"
[parameters]
armature = {{ field = "joint/a/damping", range = [0.0, 5.0], scale = "absolute" }}
"""

    def task(self, step):
        (self.folder / "m.xml").write_text(self.MODEL.format(step=step))
        (self.folder / "task.toml").write_text(self.TASK.format())
        rows = "\n".join(f"{e},{0.02 * i:.2f},{np.sin(i / 9 + e):.6f},{np.cos(i / 9 + e):.6f},{np.sin(i / 3):.4f}"
                         for e in range(3) for i in range(200))
        (self.folder / "logs.csv").write_text("episode,time,obs.joint/a/qpos,obs.joint/a/qvel,action.a\n" + rows + "\n")
        return self.folder / "task.toml"

    def test_options_that_no_simulation_ends_with_are_refused(self):
        for step in ("nan", "1e-12", "1e-10", "0", "-1", "inf"):
            result = subprocess.run([program.OTED, "params", "list", "--task", self.task(step)], capture_output=True, text=True,
                                    cwd=self.folder, timeout=60)
            self.assertIn(result.returncode, (USAGE, DATA_OR_MODEL), step)
            self.assertRegex(result.stderr, r"\Aoted: [^\n]+\n\Z")
            self.assertFalse((self.folder / "MUJOCO_LOG.TXT").exists())

    def test_a_signal_is_answered_within_two_seconds(self):
        task = self.task("2e-7")  # 100,000 steps of the physics in a control period
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            child = subprocess.Popen([program.OTED, "design", task, "--out", self.out, "--threads", "2"], stdout=subprocess.DEVNULL,
                                     stderr=subprocess.DEVNULL)
            time.sleep(1)
            self.assertIsNone(child.poll(), "it had ended by itself")
            start = time.monotonic()
            child.send_signal(number)
            self.assertEqual(child.wait(timeout=20), INTERRUPTED)
            # The scheduler of a loaded machine included.
            self.assertLess(time.monotonic() - start, 3.5)

    def test_a_signal_that_the_parent_blocks_and_an_end_of_processor_time_are_answered(self):
        task = self.task("2e-7")
        design = [program.OTED, "design", task, "--out", self.out, "--threads", "1"]
        blocked = {signal.SIGTERM, signal.SIGALRM}
        child = subprocess.Popen(design, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                 preexec_fn=lambda: signal.pthread_sigmask(signal.SIG_BLOCK, blocked))
        self.addCleanup(child.kill)
        time.sleep(1)
        child.send_signal(signal.SIGTERM)
        self.assertEqual(child.wait(timeout=20), INTERRUPTED)
        limited = subprocess.run(design, capture_output=True, text=True, timeout=60, check=False,
                                 preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (1, 30)))
        self.assertEqual(limited.returncode, INTERRUPTED, limited.stderr)

    def full_pipe(self):
        """The end to write to of a pipe that takes nothing more."""
        read, write = os.pipe()
        self.addCleanup(os.close, read)
        self.addCleanup(os.close, write)
        os.set_blocking(write, False)
        try:
            while True:
                os.write(write, b"x" * select.PIPE_BUF)
        except BlockingIOError:
            os.set_blocking(write, True)
        return write

    def test_a_signal_is_answered_though_nobody_reads_what_is_printed(self):
        task = self.task("2e-7")
        for words, stream in ((["design", task, "--out", self.out, "--threads", "2"], "stderr"),
                              (["design", task, "--out", self.out, "--threads", "2", "--quiet"], "stderr"), (["schema"], "stdout")):
            streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, stream: self.full_pipe()}
            child = subprocess.Popen([program.OTED, *map(str, words)], **streams)
            self.addCleanup(child.wait)
            self.addCleanup(child.kill)
            time.sleep(1)
            self.assertIsNone(child.poll(), "it had ended by itself")
            child.send_signal(signal.SIGTERM)
            self.assertEqual(child.wait(timeout=20), INTERRUPTED, (words, stream))


class TestHostileInput(ProgramTest):
    def assertRefusedCheaply(self, *arguments, needle):
        result, peak = peak_memory(*arguments)
        self.assertOneLine(result, DATA_OR_MODEL, needle)
        self.assertLess(peak, 2 * GIB)

    def bomb(self, member, n):
        """An archive with `n` zeros, of a thousandth of the size."""
        header = io.BytesIO()
        np.lib.format.write_array_header_1_0(header, {"descr": "|u1", "fortran_order": False, "shape": (n // 11, 11)})
        path = self.folder / "bomb.npz"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            with archive.open(member + ".npy", "w", force_zip64=True) as file:
                file.write(header.getvalue())
                for _ in range(n >> 20):
                    file.write(bytes(1 << 20))
        self.assertLess(path.stat().st_size, 8 << 20)
        return path

    def test_archives_that_unpack_without_end_are_refused(self):
        for member in ("observations", "never_read"):
            self.assertRefusedCheaply("data", "info", self.bomb(member, 1 << 30), needle="bomb.npz")
        path = self.folder / "bomb.csv.gz"
        with gzip.open(path, "wb") as file:
            file.write(b"obs_0,action_0\n")
            for _ in range(600):
                file.write(b"0,0\n" * (1 << 18))
        self.assertRefusedCheaply("data", "info", path, needle="bomb.csv.gz")

    def test_models_that_grow_without_end_are_refused(self):
        for root in ('<asset><texture name="x" type="2d" builtin="flat" width="60000" height="60000"/></asset>',
                     '<sensor><user dim="1000000000"/></sensor>'):
            path = self.folder / "big.xml"
            log = self.folder / "log.csv"
            log.write_text("time,j_pos\n0,0\n1,0\n")
            path.write_text(f'<mujoco>{root}<worldbody><body><joint name="a"/><geom size="1"/></body></worldbody></mujoco>')
            self.assertRefusedCheaply("init", path, log, "--out", self.folder / "task.toml", needle="big.xml")

    def test_what_fits_the_budget_is_read_below_two_gigabytes(self):
        path = self.folder / "flat.csv.gz"
        with gzip.open(path, "wb") as file:
            file.write(b"obs_0,action_0\n" + b"0,0\n" * (15 << 20))
        result, peak = peak_memory("data", "info", path)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertLess(peak, 2 * GIB)

    def test_names_that_are_no_files_are_usage_errors(self):
        for ending in ("csv", "npz", "hdf5", "csv.gz"):
            device = self.folder / f"device.{ending}"
            device.symlink_to("/dev/zero")
            fifo = self.folder / f"fifo.{ending}"
            os.mkfifo(fifo)
            for path in (device, fifo):
                self.assertOneLine(oted("data", "info", path), USAGE, path.name)
        (self.folder / "p.onnx").symlink_to("/dev/zero")
        self.assertOneLine(oted("evaluate", "--task", "Hopper-v5", "--policy", self.folder / "p.onnx"), USAGE, "p.onnx")
        self.assertOneLine(oted("run", "/dev/zero", "--out", self.out), USAGE, "/dev/zero")
        self.assertOneLine(oted("report", "--out", "a" * 300), USAGE, "aaa")
        self.assertOneLine(oted("run", "a" * 300 + ".toml", "--out", self.out), USAGE, "aaa")
        for words in ([b"data", b"info", b"a\xff.csv"], [b"report", b"a\xff"], [b"run", b"--out", b"\xc3\x28"]):
            result = subprocess.run([program.OTED.encode(), *words], capture_output=True)
            self.assertEqual(result.returncode, USAGE, result.stderr)
            self.assertIn("not UTF-8", result.stderr.decode())


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
