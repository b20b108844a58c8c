"""The first screen of a finished run's report as a PNG for the README.

    report_picture.py RUN_DIRECTORY PNG

Takes RUN_DIRECTORY/report.html as it is, in headless Chromium ($CHROMIUM, default: chromium) in light colours.
"""

import argparse
import io
import pathlib
import sys

from PIL import Image

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests/browser"))
import chromium  # noqa: E402  the browser's options, as the tests of the page have them

WIDTH, HEIGHT = 1200, 770  # the headline and its three columns
MOST_BYTES = 250_000


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=pathlib.Path)
    parser.add_argument("png", type=pathlib.Path)
    arguments = parser.parse_args()
    page = arguments.run / "report.html"
    if not page.is_file():
        raise SystemExit(f"report_picture.py: '{page}' does not exist; run `make quickstart`, or name a finished run by OUT=")
    with chromium.Page() as browser:
        browser.show(page, WIDTH, HEIGHT)
        image = Image.open(io.BytesIO(browser.screenshot())).convert("RGB").crop((0, 0, WIDTH, HEIGHT))
    # A palette is what the page's few colours need, and a quarter of the size.
    image.quantize(256, dither=Image.Dither.NONE).save(arguments.png, optimize=True)
    size = arguments.png.stat().st_size
    if size > MOST_BYTES:
        raise SystemExit(f"report_picture.py: '{arguments.png}' has {size:,} bytes, wanted {MOST_BYTES:,} at most")
    print(f"{arguments.png}: {WIDTH} x {HEIGHT}, {size:,} bytes")


if __name__ == "__main__":
    main()
