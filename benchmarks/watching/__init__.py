"""Streams: how often the test alarms without a cause, and how fast and with what memory windows are taken."""
