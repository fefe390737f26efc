"""Fuzzing guided by coverage: ``python -m tests.fuzz.guided --form toml --minutes 10``.

libFuzzer, by way of atheris (``pip install -e '.[fuzz]'``), changes the seeds byte by byte and goes
on with what reaches new branches of the readers. The first fault ends it, and its bytes are kept.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["vibro_cli.scenario", "tomllib", "json", "ruamel"]):
    from tests.fuzz.judge import Found, judge_one
    from tests.fuzz.mutation import FORMS, WORDS, seeds
    from vibro_cli.assemble import build_any
    from vibro_cli.scenario import load_any


def corpus(folder: Path, form: str) -> None:
    """Write the seeds, and the tokens that libFuzzer may insert, to files."""
    (folder / "seeds").mkdir()
    for number, text in enumerate(seeds(form)):
        (folder / f"seeds/{number}").write_text(text, encoding="utf-8")
    escaped = ("".join(f"\\x{byte:02x}" for byte in word.encode()[:60]) for word in WORDS)
    (folder / "words").write_text("".join(f'"{word}"\n' for word in escaped))


def main() -> None:
    """Fuzz one parser until the time is over or a fault is found."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.guided", description=__doc__)
    parser.add_argument("--form", choices=FORMS, default="toml")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--runs", type=int, default=-1, help="texts at most [default: no limit]")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="vibro-fuzz-") as name:
        folder = Path(name)
        corpus(folder, chosen.form)
        file = folder / f"scenario.{chosen.form}"

        def read(content: bytes) -> None:
            file.write_bytes(content)
            found = Found()
            judge_one(lambda: build_any(load_any(file)), found, "this text")
            if found.faults:
                raise RuntimeError(found.faults[0])

        options = (
            f"-max_total_time={int(60 * chosen.minutes)}", f"-runs={chosen.runs}",
            f"-dict={folder / 'words'}", "-max_len=20000", "-print_final_stats=1",
            "-rss_limit_mb=1000", f"-artifact_prefix=fault-{chosen.form}-",
        )  # fmt: skip
        atheris.Setup([sys.argv[0], *options, str(folder / "seeds")], read)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
