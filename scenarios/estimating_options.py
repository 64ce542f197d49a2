"""The keys of [estimate.options], under the name that users of `estimate` know."""

from scenarios.declaration import Alarm, Options

__all__ = ["Alarm", "Options"]
