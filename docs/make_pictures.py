"""Make the pictures of the documentation with the program: ``python docs/make_pictures.py``.

Those of README are figures of `vibro report --figures` and `vibro bench`, the map is that of the
sweep that README shows; those of the page on the papers are what its own commands write. All have
as many colours as a PNG palette holds, so that the repository stays small. Names of pictures after
the command make these only: ``python docs/make_pictures.py gallery papers``.
"""

import os
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from vibro_cli.commands.help import LETTERS, rows_of

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
PICTURES = ROOT / "docs" / "pictures"
RUN = ("run", "scenarios/three_arcs.toml", "--set", "stop.time=12")
# Which figures of the run and of the sweep become which pictures.
FIGURES = {"run": {"scene": "scene", "portrait_1": "portrait"}, "grid": {"impacts": "map"}}


GALLERY = {
    "one_circle": "portrait_1",
    "turning_circle": "portrait_1",
    "closed_three_balls": "space_time",
    "five_balls": "energy",
    "springs/two_disks": "portrait_1",
    "table/elliptic_wall": "plan",
    "table/billiards": "plan",
    "line_between_valleys": "velocities",
}
"""Scenarios of the gallery, and the figure of each that stands for it."""
THUMBNAIL = (420, 330)
"""Pixels of a thumbnail with its name."""
SCENE = "three_arcs"
"""The scene of the benchmark whose figure README shows."""
OF_THE_PAPERS = ROOT / "docs" / "papers"
# Which figures of the results of the papers' commands become which pictures.
PAPERS = {
    "three_arcs": {"velocities": "A1a"},
    "model": {"scene": "A2a"},
    "circle_three": {"portrait_1": "A1b1", "portrait_2": "A1b2"},
    "three_arcs-portrait": {"family": "A2bcd"},
    "eight": {"energy_portrait_1": "A-energies"},
    "translation": {"velocities": "B1"},
    "equal": {"contact_points": "B2"},
    "horizontal_line_2_3": {"contact_points": "B3", "velocities": "B5"},
    "one_circle": {"scene": "B6", "velocities": "B7", "energy": "B-energies"},
    "circle_two": {"portrait_2": "B8-upper", "portrait_1": "B8-lower", "plan": "B9"},
    "progressive": {"energy_portrait_2": "B-progressive"},
    "elliptic_wall": {"plan": "C1", "velocities": "C1-velocities"},
    "wall_points": {"contact_points": "C2a"},
    "convex_wall": {"plan": "C2b", "velocities": "C2c"},
    "elliptic_wall-portrait": {"portrait_1": "C-billiards"},
    "skew": {"contact_points": "C3", "velocities": "C4", "plan": "C4-paths"},
    "common_origin": {"scene": "C5a", "portrait_1": "C5b1", "portrait_2": "C5b2"},
    "two_disks-portrait": {"portrait_1": "C-trigger"},
    "springs_family": {"family": "C-family"},
    "lone_particle": {"scene": "D1a"},
    "disk_on_arcs": {"scene": "D1b", "energy_portrait_1": "D-eight"},
    "ball_on_arcs-portrait": {"family": "D1cde"},
    "particle_on_arcs-portrait": {"comparison": "D-analogy"},
    "lone_particle-portrait": {"portrait_1": "D-condition"},
    "turning_valley-portrait": {"family": "D-turning"},
    "turning_valley": {"energy_portrait_1": "D-turning-impacts"},
}  # fmt: skip
SHARE, COLOURS = 0.62, 96
"""Of the width of those pictures, and the number of colours with which no hue becomes grey."""


def vibro(*arguments: str) -> None:
    """Run the program from the root of the repository."""
    subprocess.run([sys.executable, "-m", "vibro_cli", *arguments], cwd=ROOT, check=True)


def sweep(folder: Path) -> str:
    """Write the sweep that README shows to a file in `folder`; its name."""
    (text,) = re.findall(
        r"^```toml\n(.*?)^```", README.read_text("utf-8"), re.MULTILINE | re.DOTALL
    )
    file = folder / "sweep.toml"
    file.write_text(text.replace('base = "', f'base = "{ROOT}/'), encoding="utf-8")
    return str(file)


def shrink(figure: Path, picture: Path, share: float = 1.0, colours: int = 256) -> None:
    """Write `figure`, or a smaller form of it, as a PNG with a palette."""
    with Image.open(figure) as image:
        size = round(image.width * share), round(image.height * share)
        small = image.convert("RGB").resize(size, Image.Resampling.LANCZOS)
        # of the methods the one that keeps a colour of few pixels, as that of a mark
        method = Image.Quantize.MAXCOVERAGE
        small.quantize(colours, method, dither=Image.Dither.NONE).save(picture, optimize=True)


def of_the_papers(work: Path) -> None:
    """Run every command of the page on the papers in a folder; put its figures into docs/papers."""
    (work / "scenarios").symlink_to(ROOT / "scenarios")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    rows = [row for letter in LETTERS for row in rows_of(letter)]
    for command in dict.fromkeys(command for _, _, command, _ in rows):
        program = [sys.executable, "-m", "vibro_cli", *shlex.split(command)[1:]]
        subprocess.run(program, cwd=work, check=True, env=environment)
    OF_THE_PAPERS.mkdir(exist_ok=True)
    for folder, pictures in PAPERS.items():
        for figure, picture in pictures.items():
            source = work / "outputs" / folder / f"{figure}.png"
            shrink(source, OF_THE_PAPERS / f"{picture}.png", SHARE, COLOURS)


def figures(work: Path) -> None:
    """Make the figures of a run and of a sweep."""
    for command in (RUN, ("grid", sweep(work))):
        results, drawn = work / command[0], work / f"{command[0]}-figures"
        vibro(*command, "-o", str(results))
        vibro("report", str(results), "-o", f"{work}/page.html", "--figures", str(drawn))
        for figure, picture in FIGURES[command[0]].items():
            shrink(drawn / f"{figure}.png", PICTURES / f"{picture}.png")


def gallery(work: Path) -> None:
    """Make one picture of thumbnails, four in a row, each above the name of its scenario."""
    wide, high = THUMBNAIL
    sheet = Image.new("RGB", (4 * wide, -(-len(GALLERY) // 4) * high), "white")
    for number, (scenario, figure) in enumerate(GALLERY.items()):
        folder = work / scenario.replace("/", "-")
        kind = "portrait" if figure.startswith("portrait") else figure
        vibro("run", f"scenarios/{scenario}.toml", "-o", str(folder), "--figures", kind)
        with Image.open(folder / f"{figure}.png") as image:
            image.thumbnail((wide - 24, high - 48), Image.Resampling.LANCZOS)
            left, top = number % 4 * wide, number // 4 * high
            middle = left + (wide - image.width) // 2, top + (high - 36 - image.height) // 2
            sheet.paste(image, middle)
        at = (left + wide // 2, top + high - 20)
        font = ImageFont.load_default(20)
        ImageDraw.Draw(sheet).text(at, Path(scenario).name, "black", font, anchor="mm")
    sheet.save(work / "gallery.png")
    shrink(work / "gallery.png", PICTURES / "gallery.png")


def precision(work: Path) -> None:
    """Make the figure of run time against error."""
    vibro("bench", "--scene", SCENE, "-o", str(work / "bench"))
    shrink(work / "bench" / "work_precision.png", PICTURES / "precision.png")


def main() -> None:
    """Solve, draw, and put the pictures into ``docs/pictures`` and ``docs/papers``."""
    PICTURES.mkdir(exist_ok=True)
    every = {
        "figures": figures,
        "gallery": gallery,
        "precision": precision,
        "papers": of_the_papers,
    }
    for wanted in sys.argv[1:] or every:
        with tempfile.TemporaryDirectory() as name:
            every[wanted](Path(name))


if __name__ == "__main__":
    main()
