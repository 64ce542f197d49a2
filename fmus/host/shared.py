"""The memory of the page of `watch`, where the process that started this one has given some."""

from typing import Any

page: Any = None
