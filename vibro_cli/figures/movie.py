"""Films as files: GIF by Pillow, MP4 by the program ffmpeg."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from io import BytesIO
from pathlib import Path

from vibro_cli.errors import VibroError
from vibro_cli.figures.motion import Frames
from vibro_cli.figures.source import Recorded
from vibro_cli.figures.stage import Film

FORMS = ("gif", "mp4")
_DPI = {"mp4": 200.0, "gif": 100.0}
_COLOURS = 64
# One thread and nothing of time or machine in the file: equal input gives equal bytes.
_ENCODING = [
    *("-an", "-c:v", "libx264", "-preset", "medium", "-crf", "18", "-pix_fmt", "yuv420p"),
    *("-threads", "1", "-map_metadata", "-1", "-fflags", "+bitexact", "-flags:v", "+bitexact"),
    *("-movflags", "+faststart", "-f", "mp4"),
]


class NoFilm(VibroError):
    """A film cannot be made; the message says why and what else there is."""


def movie(run: Recorded, frames: Frames, rate: int, form: str) -> bytes:
    """Return a film of a run as the bytes of a file; `form` is `gif` or `mp4`.

    `rate` is the number of frames in a second. Raises `NoFilm` where ffmpeg is not there, or fails.
    """
    if form == "mp4" and shutil.which("ffmpeg") is None:
        raise NoFilm(
            "a film as .mp4 needs the program ffmpeg, which is not there; .gif and .html do not"
        )
    film = Film(run, frames, _DPI[form])
    return _gif(film, rate) if form == "gif" else _mp4(film, rate)


def _gif(film: Film, rate: int) -> bytes:
    from PIL import Image

    first = Image.fromarray(film.picture(0)).quantize(_COLOURS)
    rest = (
        Image.fromarray(film.picture(frame)).quantize(palette=first, dither=Image.Dither.NONE)
        for frame in range(1, len(film.frames.time))
    )
    content = BytesIO()
    first.save(
        content,
        format="GIF",
        save_all=True,
        append_images=rest,
        duration=round(1000 / rate),
        loop=0,
    )
    return content.getvalue()


def _mp4(film: Film, rate: int) -> bytes:
    first = film.picture(0)
    size = f"{first.shape[1]}x{first.shape[0]}"
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", str(rate), "-i", "-"]
    with tempfile.TemporaryDirectory() as folder:
        target, words = Path(folder) / "film.mp4", Path(folder) / "words"
        command = ["ffmpeg", "-nostdin", "-v", "error", "-y", *raw, *_ENCODING, str(target)]
        with (
            words.open("wb") as said,
            subprocess.Popen(command, stdin=subprocess.PIPE, stderr=said) as encoder,
        ):
            assert encoder.stdin is not None
            try:
                for frame in range(len(film.frames.time)):
                    encoder.stdin.write(film.picture(frame).tobytes())
            except BrokenPipeError:
                pass  # ffmpeg gave up; its own words say why
            finally:
                encoder.stdin.close()
        if encoder.returncode:
            said_last = words.read_text(errors="replace").strip().rpartition("\n")[2]
            raise NoFilm(f"ffmpeg could not write the film: {said_last or encoder.returncode}")
        return target.read_bytes()
