"""The same targets under atheris, which mutates towards code it has not seen; called by `run.py --atheris SECONDS`."""

import importlib
import sys
import tempfile
from pathlib import Path


def search(name: str, seconds: int, keep: Path) -> int:
    """Search one target for so long; libFuzzer ends the process at the first failure and keeps its input."""
    try:
        atheris = importlib.import_module("atheris")  # not a dependency
    except ImportError:
        print("atheris is not installed: pip install atheris, in an environment of its own", file=sys.stderr)
        return 2
    with atheris.instrument_imports(include=["maipp", "yaml"]):
        from fuzz_check import check
        from fuzz_targets import TARGETS

    target = TARGETS[name]
    keep.mkdir(parents=True, exist_ok=True)
    corpus, folder = (Path(tempfile.mkdtemp(prefix=f"{name}-")) for _ in range(2))
    for number, seed in enumerate(target.seeds()):
        (corpus / f"seed-{number}").write_bytes(seed)
    words = corpus.with_suffix(".dict")
    words.write_text("".join(f'"{_escaped(token)}"\n' for token in target.tokens if token))

    options = [f"-max_total_time={seconds}", f"-artifact_prefix={keep / name}-", "-timeout=20", "-rss_limit_mb=4096"]

    def one_input(data: bytes) -> None:
        check(target, data, folder)

    atheris.Setup([sys.argv[0], *options, f"-dict={words}", str(corpus)], one_input)
    atheris.Fuzz()
    return 0


def _escaped(token: bytes) -> str:
    """The token as libFuzzer's dictionaries write it."""
    return "".join(f"\\x{byte:02x}" for byte in token)
