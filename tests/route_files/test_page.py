import re
from pathlib import Path

PAGE = (Path(__file__).parents[2] / "docs" / "route-files.md").read_text(encoding="utf-8")


def test_the_example_on_the_page_writes_the_files_it_lists(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (example,) = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    values: dict = {}
    exec(compile(example, "route-files.md", "exec"), values)
    written = {path.name for path in values["paths"]}
    listed = set(re.findall(r"^\| `([^`]+)`", PAGE.partition("\n## ")[0], flags=re.MULTILINE))
    own = {"<robot>.plan", "<robot>.waypoints"}
    assert written == listed - own - {"routes-in-metres.json"} | {"Northern boat.plan", "Northern boat.waypoints"}
    assert {path.name for path in (tmp_path / "out" / "missions").iterdir()} == written


def test_the_page_names_the_columns_and_kinds(plan):
    from maipp.route_files.geojson import geojson_file
    from maipp.route_files.waypoints_csv import waypoints_csv_file

    assert f"`{waypoints_csv_file(plan).splitlines()[0].replace(',', ', ')}`" in PAGE
    kinds = set(re.findall(r'"kind": "([\w-]+)"', geojson_file(plan)))
    table = PAGE.partition("| `kind` |")[2]
    assert kinds == set(re.findall(r"^\| `([\w-]+)` \|", table, flags=re.MULTILINE))
