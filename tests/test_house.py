"""The layout that CONTRIBUTING.md draws is the layout that stands."""

import configparser
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = sorted(
    path
    for folder in ("plugins", "adapters")
    for path in (ROOT / folder).iterdir()
    if path.is_dir() and path.name != "__pycache__"
)


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.name)
def test_every_plugin_and_adapter_is_a_typed_package_named_robid(package: Path) -> None:
    assert package.name.startswith("robid_")
    assert (package / "py.typed").is_file()
    assert (package / "__init__.py").is_file()


def test_import_rules_know_every_package() -> None:
    rules = configparser.ConfigParser()
    rules.read(ROOT / ".importlinter")
    names = {package.name for package in PACKAGES}
    assert set(rules["importlinter"]["root_packages"].split()) == names | {"robid_core"}
    assert set(rules["importlinter:contract:core-alone"]["forbidden_modules"].split()) == names
    assert set(rules["importlinter:contract:independent"]["modules"].split()) == names
    assert set(rules["importlinter:contract:two-doors"]["source_modules"].split()) == names


def test_the_second_door_is_shut_for_every_other_module_of_the_core() -> None:
    rules = configparser.ConfigParser()
    rules.read(ROOT / ".importlinter")
    shut = set(rules["importlinter:contract:two-doors"]["forbidden_modules"].split())
    children = {
        f"robid_core.{path.stem}"
        for path in (ROOT / "robid_core").iterdir()
        if (path.suffix == ".py" or (path / "__init__.py").is_file()) and path.stem != "__init__"
    }
    doors = {"robid_core.mechanics", "robid_core.estimation", "robid_core.residual", "robid_core.plot"}
    assert children - shut == doors


def test_no_module_has_a_name_that_says_nothing() -> None:
    vague = re.compile(r"^(utils?|helpers?|common|misc)$")
    modules = [
        path for folder in ("robid_core", "plugins", "adapters") for path in (ROOT / folder).rglob("*.py")
    ]
    assert modules
    assert not [path for path in modules if vague.match(path.stem)]


def test_half_of_all_modules_are_short_and_none_is_a_monster() -> None:
    lengths = sorted(
        len(path.read_text(encoding="utf-8").splitlines())
        for folder in ("robid_core", "plugins", "adapters")
        for path in (ROOT / folder).rglob("*.py")
    )
    assert lengths[len(lengths) // 2] < 150
    assert lengths[-1] <= 400


def test_the_house_in_contributing_names_every_folder_and_module_of_the_core() -> None:
    drawing = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    for path in (ROOT / "robid_core").iterdir():
        if path.name.startswith(("__", ".")) or path.name == "py.typed":
            continue
        assert re.search(rf"\b{re.escape(path.name)}", drawing), path.name
