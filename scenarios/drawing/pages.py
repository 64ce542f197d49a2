"""Pages from templates: what is written into them is escaped, and a value that is missing is an error."""

from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

SHARED = Path(__file__).parents[1] / "closing"  # the style sheet of the report, for other pages too


def rendered(home: Path, template: str, **values: Any) -> str:
    """A page from a template in the folder `home`; it may include files of it and the shared style sheet."""
    env = Environment(
        loader=FileSystemLoader([home, SHARED]), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    return env.get_template(template).render(**values)
