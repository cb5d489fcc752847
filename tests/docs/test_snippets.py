"""Snippets of README and docs/: Python compiles, TOML is read; those of tutorials are run as they stand."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.support.pages import DOCS, ROOT, blocks, run


def python_of(page: str) -> list[str]:
    found = [block.text for block in blocks("python") if block.page == page]
    assert found
    return found


def test_python_compiles() -> None:
    snippets = list(blocks("python"))
    assert len(snippets) > 20
    for page, _, text in snippets:
        compile(text, page, "exec")


def test_toml_is_read() -> None:
    snippets = list(blocks("toml"))
    assert len(snippets) > 5
    for _, _, text in snippets:
        tomllib.loads(text)


def test_readme_and_the_first_flight_show_the_same() -> None:
    assert python_of("README.md") == python_of("docs/first-flight.md")
    shown = [
        re.findall(r"^[┌│└].*$", path.read_text(), re.MULTILINE)
        for path in (ROOT / "README.md", DOCS / "first-flight.md")
    ]
    assert shown[0] == shown[1]


@pytest.mark.long
def test_the_snippet_of_readme_runs(tmp_path: Path) -> None:
    (tmp_path / "snippet.py").write_text(python_of("README.md")[0], encoding="utf-8")
    assert float(run(tmp_path, "-W", "error", "snippet.py")) == pytest.approx(0.0052, abs=1e-4)
    assert (tmp_path / "error.png").is_file()


@pytest.mark.long
def test_the_tutorial_of_a_law_of_one_s_own_comes_out_as_it_says(tmp_path: Path) -> None:
    law, *trials, campaign, gate = python_of("docs/your-own-law.md")
    for name, text in {"my_law": law, "try_it": "\n".join(trials), "campaign": campaign, "gate": gate}.items():
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    said = run(tmp_path, "try_it.py").splitlines()
    lost, height_m = said[0].split()
    assert lost == "None"
    assert float(height_m) == pytest.approx(3.0, abs=1e-4)
    assert float(said[1]) == pytest.approx(0.43, abs=5e-3)
    assert [float(line.split()[-1]) for line in said[2:4]] == pytest.approx([0.048, 0.012], abs=5e-4)
    assert said[4].split()[0] == "True"
    run(tmp_path, "campaign.py")
    who = ("-c", "user.name=a", "-c", "user.email=a@b")
    for words in (("init", "-q", "-b", "main"), ("add", "my_law.py"), (*who, "commit", "-q", "-m", "law")):
        subprocess.run(["git", *words], cwd=tmp_path, check=True)
    assert run(tmp_path, "gate.py").startswith("lost 0, before 0; median ")
    page = (DOCS / "your-own-law.md").read_text(encoding="utf-8")
    promised = re.findall(r"^\| (\d+) \| 0 of 8 \| ([\d.]+) m \| ([\d.]+) m \| ([\d.]+) m \|$", page, re.MULTILINE)
    rows = [row.split(",") for row in (tmp_path / "out" / "spring" / "summary.csv").read_text().splitlines()[1:]]
    assert [f"{float(row[0]):g}" for row in rows] == [row[0] for row in promised]
    for row, (_, *numbers) in zip(rows, promised, strict=True):
        assert [float(number) for number in row[7:10]] == pytest.approx([*map(float, numbers)], abs=5e-3)


@pytest.mark.long
def test_the_tutorial_of_a_sitl_test_passes_and_fails_as_it_says(tmp_path: Path) -> None:
    page = (DOCS / "first-sitl-test.md").read_text(encoding="utf-8")
    text = "\n\n".join(python_of("docs/first-sitl-test.md"))
    test = tmp_path / "test_hover.py"
    test.write_text(text, encoding="utf-8")
    run(tmp_path, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_hover.py")
    test.write_text(text.replace("abs=0.3", "abs=0.001"), encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_hover.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    (block,) = re.findall(r"```\n(sitl = <.*?)```", page, re.DOTALL)
    for line in filter(None, block.splitlines()):
        assert line in done.stdout
