"""Plan-view wheelset on straight track; equations in README.md."""
