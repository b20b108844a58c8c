"""A finished design: a run directory, read."""

import enum
import html
import json
import os
import pathlib
import shutil
import tempfile
import weakref
from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oted import _given, _toml
from oted._engine import core
from oted._needs import need
from oted.errors import DataError, Error, UsageError
from oted.logs import Logs, file_of, write_logs


MOST_SAMPLES = 100_000_000


class Verdict(enum.StrEnum):
    """What a design says of the whole simulator. `Design.sentence` says why."""

    NO_GAP = "no_gap"
    GAP_CLOSED = "gap_closed"
    GAP_NARROWED = "gap_narrowed"
    OUTSIDE_FAMILY = "outside_family"
    UNDECIDED = "undecided"


class Validation:
    """How the design predicts logs, open loop, in each channel and over each horizon [s]: logs that it did not see, or, where
    a horizon's `learned` is true, those that it learned from, as no others were long enough."""

    def __init__(self, record: dict[str, Any]) -> None:
        self.record = record
        self.horizons: list[float] = [horizon["seconds"] for horizon in record["horizons"]]
        self.n_windows: list[int] = [horizon["n_windows"] for horizon in record["horizons"]]
        self.learned: list[bool] = [horizon["learned"] for horizon in record["horizons"]]
        self.longest: dict[str, Any] | None = record.get("longest")  # how far replays can be followed (docs/file_formats.md)

    def rows(self) -> list[dict[str, Any]]:
        """Root mean square errors in the channel's unit: of the nominal and the designed simulator, and what the sensors'
        noise alone leaves."""
        columns = ("name", "unit", "nominal", "designed", "floor")
        return [{"horizon": horizon["seconds"], **{column: channel[column] for column in columns}, "learned": horizon["learned"]}
                for horizon in self.record["horizons"] for channel in horizon["channels"]]

    def table(self) -> Any:
        """The same as a pandas DataFrame."""
        return need("pandas", "a table").DataFrame(self.rows())

    def __repr__(self) -> str:
        lines = [f"{'channel':<34} {'horizon':>8} {'nominal':>10} {'designed':>10} {'sensors':>10}"]
        for row in self.rows():
            name = row["name"] + (f" [{row['unit']}]" if row["unit"] else "")
            lines.append(f"{name:<34} {row['horizon']:>6.3g} s {_number(row['nominal']):>10} {_number(row['designed']):>10} "
                         f"{_number(row['floor']):>10}{' *' if row['learned'] else ''}")
        if any(self.learned):
            lines.append("* on logs that the design learned from: none that were kept aside are long enough")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return _html_table(self.rows())


class LaterValidation(Validation):
    """The same of recordings that came later: Design.validate."""

    def __init__(self, record: dict[str, Any]) -> None:
        super().__init__(record["validation"])
        self.sentence: str = record["sentence"]
        self.warnings: list[str] = record["warnings"]
        self.predicts_better: bool = record["predicts_better"]  # than the nominal simulator, beyond chance
        self.reaches_floor: bool = record["reaches_floor"]  # what it leaves, the sensors explain
        self.model: Validation | None = Validation(record["model"]["validation"]) if "model" in record else None

    def __repr__(self) -> str:
        return "\n".join([super().__repr__(), *(f"warning: {warning}" for warning in self.warnings), self.sentence])


class Design:
    """What a design found and how far to trust it. `path` is its run directory, which the program `oted` goes on with."""

    def __init__(self, path: str | os.PathLike[str], *, temporary: bool = False) -> None:
        self.path = pathlib.Path(_given.path("path", path, "the path of a run directory"))
        if temporary:  # nothing of it outlives the object
            weakref.finalize(self, shutil.rmtree, self.path, True)
        file = self.path / "design.json"
        try:
            text = file.read_text(encoding="utf-8")
            core.check_record(str(self.path))  # whole, and as it was written
            self.record: dict[str, Any] = json.loads(text)
            self.parameters: list[dict[str, Any]] = self.record["parameters"]
            self._verdict = Verdict(self.record["verdict"])
        except Error:
            raise
        except OSError as e:
            raise UsageError(f"'{self.path}' holds no design.json ({e.strerror}); name a run directory with a finished "
                             "design") from e
        except (ValueError, KeyError) as e:
            raise DataError(f"'{file}' is damaged ({e}); make the design again") from e
        self._sampler: Any = None

    @property
    def task(self) -> str:
        name: str = self.record["task"]
        return name

    @property
    def verdict(self) -> Verdict:
        return self._verdict

    @property
    def sentence(self) -> str:
        """The verdict in one sentence, with the figures that it rests on."""
        sentence: str = self.record["sentence"]
        return sentence

    @property
    def names(self) -> list[str]:
        return [p["name"] for p in self.parameters]

    @property
    def mode(self) -> dict[str, float]:
        """The best-scoring seed's mode of q, in the parameters' units (multiples of nominal, or absolute)."""
        return {p["name"]: p["mode"] for p in self.parameters}

    @property
    def nominal(self) -> dict[str, float]:
        return {p["name"]: p["nominal"] for p in self.parameters}

    @property
    def validation(self) -> Validation | None:
        """None where no state can be set or episodes are too short."""
        record = self.record.get("validation")
        return Validation(record) if record else None

    @property
    def suspects(self) -> list[dict[str, Any]]:
        """What is not among the parameters and would explain what is left."""
        return list((self.record.get("fit") or {}).get("suspects", []))

    @property
    def warnings(self) -> list[str]:
        return list(self.record["warnings"])

    @property
    def report(self) -> pathlib.Path:
        """One HTML file that opens offline."""
        return self.path / "report.html"

    def rows(self) -> list[dict[str, Any]]:
        """One dict per parameter: parameter (its name), unit, nominal, mode, std, the 90 % interval's ends q05 and q95, verdict,
        field."""
        return [{"parameter": p["name"], "unit": p["unit"], "nominal": p["nominal"], "mode": p["mode"], "std": p["std"],
                 "q05": p["interval90"][0], "q95": p["interval90"][1], "verdict": p["verdict"], "field": p["field"]}
                for p in self.parameters]

    def table(self) -> Any:
        """The same as a pandas DataFrame, indexed by parameter."""
        return need("pandas", "a table").DataFrame(self.rows()).set_index("parameter")

    def samples(self, n: int, seed: int = 0) -> NDArray[Any]:
        """n draws of q, the mixture of the seeds in turn, as a structured array: samples(1000)["friction"]."""
        values = self.draw(n, seed)
        return np.ascontiguousarray(values).view([(name, np.float64) for name in self.names]).reshape(n)

    def draw(self, n: int, seed: int = 0) -> NDArray[np.float64]:
        """The same as (n, parameters)."""
        n, seed = _given.whole("samples", n, 1, MOST_SAMPLES), _given.seed(seed)
        if self._sampler is None:
            self._sampler = core.Sampler(str(self.path))
        drawn: NDArray[np.float64] = self._sampler.draw(n, seed)
        return drawn

    @property
    def modes(self) -> NDArray[np.float64]:
        """(seeds, parameters): the mode of each seed's q, in which agents train (Algorithm 2)."""
        return np.array([member["mode"] for member in self.record["mixture"]], dtype=np.float64)

    def to_mjcf(self, path: str | os.PathLike[str], member: str | int = "best") -> pathlib.Path:
        """Writes the designed model. member: "best", or a seed's number."""
        return pathlib.Path(core.export_design(str(self.path), _given.path("path", path), "", str(member))[0])

    def to_spec(self, member: str | int = "best") -> Any:
        """The designed model as a mujoco.MjSpec."""
        mujoco = need("mujoco", "an MjSpec")
        with tempfile.TemporaryDirectory() as folder:
            return mujoco.MjSpec.from_file(str(self.to_mjcf(pathlib.Path(folder) / "designed.xml", member)))

    def to_sysid(self, path: str | os.PathLike[str]) -> pathlib.Path:
        """Writes the parameters as a file that mujoco.sysid's ParameterDict.load_from_disk reads."""
        return pathlib.Path(core.export_design(str(self.path), "", _given.path("path", path), "best")[0])

    def to_arviz(self, n: int = 1000, seed: int = 0) -> Any:
        """q as ArviZ has a posterior: a chain per seed, n draws each; and the constants nominal, low, high."""
        n = _given.whole("n", n, 1)
        arviz = need("arviz", "to_arviz")
        n_seeds = len(self.modes)
        drawn = self.draw(n * n_seeds, seed).reshape(n, n_seeds, -1)
        posterior = {name: drawn[:, :, i].T for i, name in enumerate(self.names)}
        constants = {"nominal": np.array([p["nominal"] for p in self.parameters]),
                     "low": np.array([p["bounds"][0] for p in self.parameters]),
                     "high": np.array([p["bounds"][1] for p in self.parameters])}
        try:
            return arviz.from_dict(posterior=posterior, constant_data=constants)
        except TypeError:  # ArviZ 1 takes one dict of groups
            return arviz.from_dict({"posterior": posterior, "constant_data": constants})

    def plot(self, axes: Any = None) -> Any:
        """Each parameter's interval between its bounds, with mode and nominal value (Matplotlib). Gives the axes."""
        pyplot = need("matplotlib.pyplot", "plot")
        if axes is None:
            axes = pyplot.subplots(figsize=(7, 0.6 + 0.5 * len(self.parameters)), layout="constrained")[1]
        elif not hasattr(axes, "annotate"):
            raise UsageError(f"axes: got {type(axes).__name__}, wanted one Axes of Matplotlib, as plt.subplots()[1] is")
        for i, p in enumerate(self.parameters):
            low, high = p["bounds"]

            def where(z: float, low: float = low, high: float = high) -> float:
                return (z - low) / (high - low)

            axes.plot([0, 1], [i, i], color="0.85", lw=6, solid_capstyle="butt", zorder=1)
            axes.plot([where(z) for z in p["interval90"]], [i, i], color="C0", lw=6, solid_capstyle="butt", zorder=2)
            axes.plot(where(p["mode"]), i, "o", color="C0", mec="white", zorder=4, label="mode" if i == 0 else None)
            axes.plot(where(p["nominal"]), i, "|", color="k", ms=14, zorder=3, label="nominal" if i == 0 else None)
            axes.annotate(f"{p['mode']:.3g} [{p['interval90'][0]:.3g}, {p['interval90'][1]:.3g}]  {p['verdict']}",
                          (1.02, i), va="center", annotation_clip=False, fontsize="small")
        axes.set_yticks(range(len(self.parameters)), [f"{p['name']} [{p['unit']}]" for p in self.parameters])
        axes.set_xlim(0, 1)
        axes.set_xticks([0, 1], ["lower bound", "upper bound"])
        axes.set_ylim(len(self.parameters) - 0.4, -0.6)  # the first on top
        axes.set_title(str(self.verdict).replace("_", " "), fontsize="medium")
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.02), ncols=2, frameon=False, fontsize="small")
        return axes

    def validate(
        self,
        logs: Logs | str | os.PathLike[str],
        *,
        model: str | os.PathLike[str] | None = None,
        threads: int | None = None,
    ) -> LaterValidation:
        """Predicts recordings of the same task that the design did not see, beside the nominal simulator and what the sensors'
        noise leaves: `oted validate`. model: an MJCF or URDF to compare with in the place of the task's own, as it is."""
        compared = "" if model is None else _given.path("model", model)
        with tempfile.TemporaryDirectory(prefix="oted-") as folder:
            data = (write_logs(logs, folder, core.Study.of_run(str(self.path), "")) if isinstance(logs, Logs)
                    else file_of(logs))
            return LaterValidation(json.loads(core.validate(
                str(self.path), data, compared, 0 if threads is None else _given.whole("threads", threads, 0))))

    def save(self, path: str | os.PathLike[str]) -> "Design":
        """Copies the run directory. @return the design there"""
        return self._copied(path)

    def _copied(self, path: str | os.PathLike[str], without: Collection[str] = ()) -> "Design":
        """A copy of the run directory, without some of its files and folders."""
        target = _given.folder("path", path)
        if target.exists():
            raise UsageError(f"'{target}' exists already; remove it or name another")
        try:
            shutil.copytree(self.path, target, ignore=lambda folder, names: without if folder == str(self.path) else ())
        except (OSError, shutil.Error) as e:
            raise DataError(f"'{self.path}' cannot be copied to '{target}': {e}; name another folder") from e
        # run.toml names logs and models from its own folder: the finished run is called again from the new one.
        given = next((target / "given").glob("logs.*"), None)
        data = _toml.section("data", {"path": given.resolve()}) if given else ""
        toml = (self.path / "run.toml").read_text(encoding="utf-8")
        what = core.Study(toml, str(self.path.resolve() / "run.toml"), data)
        core.run_stage(what, str(target), [], "design", "oted.Design.save", None)
        return Design(target)

    def __deepcopy__(self, memo: dict[int, Any]) -> "Design":
        return self  # it never changes

    def __reduce__(self) -> tuple[Any, ...]:
        return Design, (str(self.path.resolve()),)

    def __repr__(self) -> str:
        lines = [f"{p['name']}: {p['mode']:.4g} [{p['interval90'][0]:.4g}, {p['interval90'][1]:.4g}] "
                 f"(nominal {p['nominal']:.4g}), {p['verdict']}" for p in self.parameters]
        suspects = [f"suspect, not among the parameters: {suspect['sentence']}" for suspect in self.suspects]
        return "\n".join([f"Design of {self.task} in '{self.path}'", *lines, self.sentence, *suspects])

    def _repr_html_(self) -> str:
        text = f"<p><b>{html.escape(self.sentence)}</b></p>" + _html_table(self.rows())
        for suspect in self.suspects:
            text += f"<p>suspect, not among the parameters: {html.escape(str(suspect['sentence']))}</p>"
        return text


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.2g}"


def _html_table(rows: list[dict[str, Any]]) -> str:
    def cell(v: Any) -> str:
        return html.escape(f"{v:.4g}" if isinstance(v, float) else str(v))

    if not rows:
        return ""
    head = "".join(f"<th>{html.escape(name)}</th>" for name in rows[0])
    body = "".join("<tr>" + "".join(f"<td>{cell(v)}</td>" for v in row.values()) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def load(path: str | os.PathLike[str]) -> Design:
    """The design in a run directory, whether oted.fit or the program made it."""
    return Design(path)
