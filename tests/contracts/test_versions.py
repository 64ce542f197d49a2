"""The files that name the version name the same one."""

import re
import tomllib

from tests.helpers.paths import ROOT


def test_the_citation_and_the_changelog_name_the_version_of_the_package() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.M)
    latest = re.search(r"^## (\d[^,\s]*)", (ROOT / "CHANGELOG.md").read_text(), re.M)
    assert cited is not None
    assert latest is not None
    assert (cited[1], latest[1]) == (version, version)
