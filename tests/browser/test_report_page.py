"""The report in a real browser: headless Chromium without a network, at phone and desktop width, light and dark.

    test_report_page.py PATH/TO/oted SCREENSHOT_FOLDER [TestClass.test_name ...]

Screenshots of every combination are left in SCREENSHOT_FOLDER. Without Chromium the tests fail and say what to install.
"""

import functools
import io
import hashlib
import json
import re
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy as np
from PIL import Image

import chromium

OTED = SCREENSHOTS = None  # from the command line
DATA = pathlib.Path(__file__).resolve().parents[2] / "examples" / "data" / "hopper-quickstart.hdf5"

CONFIG = f"""
[task]
name = "Hopper-v5"
[data]
path = "{DATA}"
episodes = 2
[parameters]
friction = {{ field = "geom/*/friction[0]", range = [0.2, 2.0] }}
gain = {{ field = "actuator/*/gainprm[0]", range = [0.2, 2.0] }}
[run]
threads = 1
[truth]
friction = 0.5
gain = 0.7
[clone]
hidden = [16]
max_steps = 40
check_interval = 20
[design.settings.short]
[design.settings.paper]
method = "paper"
[selection]
n_seeds = 2
n_sims = 2
n_steps = 20
judge_steps = 20
[agents]
n_agents = 2
selection_episodes = 2
target_episodes = 2
[sac]
n_steps = 200
learning_starts = 100
batch_size = 32
hidden = [16]
eval_interval = 50
eval_episodes = 1
[report]
replay_steps = 15
"""
TINY = ["adversarial.n_iterations=6", "adversarial.n_sims=4", "adversarial.n_steps=20", "discriminator.hidden=16",
        "discriminator.steps=5", "discriminator.batch=32", "trajectories.tried=1", "trajectories.rows=96",
        "trajectories.window=16", "trajectories.coarse=8", "trajectories.starts=1"]

VIEWS = {"desktop": dict(width=1280, height=800), "phone": dict(width=390, height=844, mobile=True)}
MODES = {"light": False, "dark": True}

# Every piece of visible text with its own colour: in the page (elements that hold text themselves) and in the plots.
# The contents bar stays in place while the page scrolls, so that a picture of the whole page shows it once, at the top.
TEXTS = """[...document.querySelectorAll("body *")].flatMap(element => {
    const text = [...element.childNodes].filter(node => node.nodeType === 3).map(node => node.data).join("").trim();
    const tag = element.tagName.toLowerCase();
    if (text === "" || ["script", "style", "noscript"].includes(tag)) return [];
    const style = getComputedStyle(element), box = element.getBoundingClientRect();
    if (style.visibility === "hidden" || style.opacity === "0" || box.width * box.height === 0) return [];
    // Scrolled out of a box of its own: the contents bar on a phone.
    const clipped = element.closest("nav div, .table, pre");
    if (clipped && box.right > clipped.getBoundingClientRect().right + 1) return [];
    if (box.width > innerWidth || tag === "option") return [];
    const svg = element instanceof SVGElement;
    return [{text: text.slice(0, 60), color: svg ? style.fill : style.color, opacity: svg ? style.fillOpacity : "1",
             x: box.x, y: box.y + scrollY, width: box.width, height: box.height}];
})"""

# Lines of the plots that carry meaning; bands and grid lines are decoration beside them.
LINES = """[...document.querySelectorAll(".plot .scatterlayer .js-line")].map(line => getComputedStyle(line))
    .filter(style => style.strokeWidth !== "0px").map(style => [style.stroke, getComputedStyle(document.body)
    .backgroundColor])"""

# What sticks out of the page to the right, and tables that hide columns.
OVERFLOW = """(() => {
    const wide = [...document.querySelectorAll("body *")].filter(element =>
        element.getBoundingClientRect().right > innerWidth + 1 && !element.closest("nav div, pre, .table, svg, .hoverlayer"));
    const cut = [...document.querySelectorAll(".table")].filter(table => table.scrollWidth > table.clientWidth + 1);
    return {page: document.documentElement.scrollWidth, screen: innerWidth,
            wide: wide.map(element => element.outerHTML.slice(0, 90)),
            cut: cut.map(table => table.textContent.slice(0, 60))};
})()"""

FIRST_SCREEN = """[...document.querySelectorAll("h1, .asked, .answer h2")]
    .filter(element => element.getBoundingClientRect().bottom < innerHeight).map(element => element.textContent)"""

PLOTS = """[...document.querySelectorAll("figure")].map(figure => {
    const plot = figure.querySelector(".plot"), box = plot.getBoundingClientRect();
    const marks = ".scatterlayer path, .barlayer path, .heatmaplayer image";
    return {title: figure.querySelector("figcaption").textContent, width: box.width, height: box.height,
            marks: plot.querySelectorAll(marks).length,
            traces: JSON.parse(figure.querySelector("script").textContent).data.length};
})"""


def luminance(rgb):
    """Relative luminance of sRGB in 0..255 (WCAG 2.1)."""
    c = np.asarray(rgb, float) / 255
    c = np.where(c <= 0.03928, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return float(c @ [0.2126, 0.7152, 0.0722])


def contrast(a, b):
    """Contrast ratio of two colours, from 1 to 21 (WCAG 2.1)."""
    high, low = sorted((luminance(a), luminance(b)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def parse(color):
    """"rgb(1, 2, 3)" or "rgba(1, 2, 3, 0.5)" as four numbers."""
    numbers = [float(part) for part in color[color.index("(") + 1:-1].split(",")]
    return numbers if len(numbers) == 4 else [*numbers, 1.0]


def background(picture, text):
    """The commonest colour in a text's box: letters cover less than half of it."""
    y, x = max(0, int(text["y"])), max(0, int(text["x"]))
    box = picture[y:int(text["y"] + text["height"]) + 1, x:int(text["x"] + text["width"]) + 1].reshape(-1, 3)
    if len(box) == 0:
        return None
    colors, counts = np.unique(box, axis=0, return_counts=True)
    return colors[counts.argmax()]


class ContrastTest(unittest.TestCase):
    def test_ratios_are_those_of_the_standard(self):
        self.assertAlmostEqual(contrast((0, 0, 0), (255, 255, 255)), 21)
        self.assertAlmostEqual(contrast((119, 119, 119), (255, 255, 255)), 4.48, places=2)  # #777: just fails
        self.assertEqual(parse("rgba(1, 2, 3, 0.5)"), [1, 2, 3, 0.5])


@functools.cache
def tiny_run():
    """A whole run with a known truth, as small as one can be; made once."""
    folder = pathlib.Path(tempfile.mkdtemp(prefix="oted-page-"))
    unittest.addModuleCleanup(shutil.rmtree, folder)
    config, out = folder / "run.toml", folder / "run"
    config.write_text(CONFIG)
    sets = [word for setting in TINY for word in ("--set", "design." + setting)]
    done = subprocess.run([OTED, "run", config, "--out", out, "--quiet", *sets], capture_output=True, text=True,
                          timeout=600)
    if done.returncode not in (0, 4):
        raise AssertionError(done.stderr)
    return out


def read_record(path):
    """Its numbers stay as they are written: the seal is of their digits."""
    return json.loads(path.read_text(), parse_float=lambda digits: "@number " + digits)


def write_sealed(path, record):
    """As the program does: an edit is refused otherwise."""
    def text(of):
        compact = json.dumps(of, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
        return re.sub(r'"@number ([^"]*)"', r"\1", compact)

    record.pop("seal", None)
    path.write_text(text({**record, "seal": hashlib.sha256(text(record).encode()).hexdigest()}))


def stretch(out):
    """Names and numbers of a run that are as long as they get."""
    path = out / "design.json"
    design = read_record(path)
    del design["inputs"]  # other names are other inputs
    design["warnings"] = ["parameter 'rear_left_knee_joint_damping_and_more' " + "changes_nothing_that_is_seen" * 8]
    names = {p["name"]: "rear_left_knee_joint_damping_of_" + p["name"] for p in design["parameters"]}
    for parameter in design["parameters"]:
        parameter.update(name=names[parameter["name"]], unit="N s/m or N m s/rad", mode=-123456.789, std=4321.5,
                         verdict="not_identified", interval90=[-987654.3, 987654.3], bounds=[-1e6, 1e6], nominal=-123456)
    for member in design["mixture"]:
        member["mode"] = [-123456.789] * len(names)
    design["correlation"] = [[1 if i == j else -0.5 for j in range(len(names))] for i in range(len(names))]
    design["settings"][0]["name"] = "a_setting_with_a_name_that_goes_on_and_on_for_ever"
    design["verdict"] = "outside_family"
    write_sealed(path, design)
    for made in out.rglob("*.json"):  # so is what was made from another design
        record = read_record(made)
        if record.pop("made_from", None) is not None:
            write_sealed(made, record)
    head, text = (out / "run.toml").read_text().split("\n", 1)
    for name, long_name in names.items():
        text = text.replace(f"\n{name} = ", f"\n{long_name} = ")
    old = re.search("[0-9a-f]{64}", head).group()
    (out / "run.toml").write_text(head.replace(old, hashlib.sha256(text.encode()).hexdigest()) + "\n" + text)
    done = subprocess.run([OTED, "report", "--out", out], capture_output=True, text=True, timeout=60)
    assert done.returncode in (0, 4), done.stderr


class ReportPage(unittest.TestCase):
    modes = MODES

    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="oted-page-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.run_dir = cls.folder / "run"
        cls.prepare()
        cls.page = chromium.Page()
        cls.page.__enter__()
        cls.addClassCleanup(cls.page.__exit__, None, None, None)
        # Each view is opened once; the tests look at what was found there.
        cls.views = {(view, mode): cls.look(size, dark) for view, size in VIEWS.items()
                     for mode, dark in cls.modes.items()}

    @classmethod
    def prepare(cls):
        shutil.copytree(tiny_run(), cls.run_dir)

    @classmethod
    def look(cls, size, dark):
        cls.page.show(cls.run_dir / "report.html", dark=dark, **size)
        found = {name: cls.page.evaluate(script) for name, script in
                 {"texts": TEXTS, "lines": LINES, "overflow": OVERFLOW, "plots": PLOTS, "first": FIRST_SCREEN}.items()}
        found["png"] = cls.page.screenshot()
        found["messages"] = [event for name in ("Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded")
                             for event in cls.page.of(name)]
        found["urls"] = [event["request"]["url"] for event in cls.page.of("Network.requestWillBeSent")]
        return found

    def test_it_opens_without_a_message_and_asks_for_nothing(self):
        for view, found in self.views.items():
            with self.subTest(view=view):
                self.assertEqual([str(message)[:300] for message in found["messages"]], [])
                self.assertEqual([url for url in found["urls"] if not url.startswith(("data:", "blob:"))],
                                 [(self.run_dir / "report.html").resolve().as_uri()])

    def test_every_plot_is_drawn(self):
        for view, found in self.views.items():
            with self.subTest(view=view):
                self.assertGreater(len(found["plots"]), 12)
                for plot in found["plots"]:
                    self.assertGreaterEqual(plot["marks"], plot["traces"], plot)
                    self.assertGreater(plot["width"], 200, plot)
                    self.assertGreater(plot["height"], 100, plot)

    def test_nothing_sticks_out_and_no_table_hides_a_column(self):
        for view, found in self.views.items():
            with self.subTest(view=view):
                overflow = found["overflow"]
                self.assertLessEqual(overflow["page"], overflow["screen"])
                self.assertEqual(overflow["wide"], [])
                self.assertEqual(overflow["cut"], [])


class UsualPage(ReportPage):
    def test_text_and_lines_stand_out_from_what_is_behind_them(self):
        SCREENSHOTS.mkdir(parents=True, exist_ok=True)
        for (view, mode), found in self.views.items():
            with self.subTest(view=view, mode=mode):
                (SCREENSHOTS / f"report-{view}-{mode}.png").write_bytes(found["png"])
                picture = np.asarray(Image.open(io.BytesIO(found["png"])).convert("RGB"))
                self.assertGreater(len(found["texts"]), 150)
                weak = []
                for text in found["texts"]:
                    behind = background(picture, text)
                    if behind is None:
                        continue
                    *color, alpha = parse(text["color"])
                    alpha *= float(text["opacity"])
                    seen = [alpha * c + (1 - alpha) * b for c, b in zip(color, behind)]
                    if contrast(seen, behind) < 4.5:
                        weak.append((text["text"], text["color"], behind.tolist(), round(contrast(seen, behind), 2)))
                self.assertEqual(weak, [], "WCAG AA asks 4.5:1 of text")
                lines = {tuple(pair) for pair in found["lines"]}
                self.assertGreater(len(lines), 3)
                for line, behind in lines:
                    self.assertGreaterEqual(contrast(parse(line)[:3], parse(behind)[:3]), 3, (line, behind))

    def test_the_first_screen_answers(self):
        for (view, mode), found in self.views.items():
            with self.subTest(view=view, mode=mode):
                self.assertIn("What came out", found["first"])
                self.assertIn("How far to trust it", found["first"])
                if view == "desktop":
                    self.assertIn("What stays unknown", found["first"])

    def test_a_request_would_be_noticed(self):
        trap = self.folder / "trap.html"
        trap.write_text("<img src='https://example.invalid/x.png'><script>console.error('trap')</script>")
        self.page.show(trap, 390, 844)
        self.assertTrue(any("example.invalid" in event["request"]["url"]
                            for event in self.page.of("Network.requestWillBeSent")))
        self.assertTrue(self.page.of("Runtime.consoleAPICalled"))

    def test_the_reader_can_play_pause_and_move_the_films_which_stay_in_step(self):
        if not (self.run_dir / "motion" / "logged.webp").exists():
            note = json.loads((self.run_dir / "motion" / "motion.json").read_text())["note"]
            self.skipTest(f"no pictures of the motion: {note}")
        self.page.show(self.run_dir / "report.html", **VIEWS["desktop"])
        draw = """[...document.querySelectorAll(".panel canvas")].map(canvas => {
            const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
            let sum = 0, squares = 0;
            for (const value of data) { sum += value; squares += value * value; }
            return [canvas.width, canvas.height, sum / data.length,
                    squares / data.length - (sum / data.length) ** 2, canvas.toDataURL()];
        })"""
        move = """(frame => {
            const slider = document.querySelector(".controls input");
            slider.value = frame; slider.dispatchEvent(new Event("input")); return slider.max; })"""
        first = self.page.evaluate(draw)
        self.assertEqual([panel[:2] for panel in first], [[256, 256]] * 3)
        for _, _, mean, variance, _ in first:
            self.assertTrue(20 < mean < 235 and variance > 400, "a blank picture")
        # All start in the logged state; at the end they have parted, as their parameters differ.
        self.assertEqual(int(self.page.evaluate(move + "(0)")), 15)
        start = [panel[4] for panel in self.page.evaluate(draw)]
        self.page.evaluate(move + "(15)")
        end = [panel[4] for panel in self.page.evaluate(draw)]
        self.assertEqual(len(set(end)), 3)
        self.assertTrue(all(a != b for a, b in zip(start, end)))
        self.assertIn("0.12", self.page.evaluate("document.querySelector('.controls output').textContent"))
        # Nothing moves for a reader who asked for less motion, until the button is pressed.
        button = "document.querySelector('.controls button')"
        self.assertEqual(self.page.evaluate(f"{button}.textContent"), "Play")
        self.assertEqual(self.page.evaluate(f"{button}.click(), {button}.textContent"), "Pause")
        # It goes on from the last frame to the first: wait for that, for as long as the protocol lets a call take.
        self.page.evaluate("""new Promise(done => {
            const look = () => document.querySelector(".controls input").value === "15" ? setTimeout(look, 50) : done();
            look(); })""")
        self.assertEqual(self.page.evaluate(f"{button}.click(), {button}.textContent"), "Play")


class LongNames(ReportPage):
    """The same page with names and numbers that are as long as they get."""
    modes = {"light": False}

    @classmethod
    def prepare(cls):
        super().prepare()
        stretch(cls.run_dir)


if __name__ == "__main__":
    OTED, SCREENSHOTS = sys.argv.pop(1), pathlib.Path(sys.argv.pop(1))
    try:
        chromium.find()
    except FileNotFoundError as error:
        sys.exit(str(error))
    unittest.main(defaultTest=None if len(sys.argv) > 1 else ["ContrastTest", "UsualPage", "LongNames"])
