"""The contents of the report: names, sentences and tables."""
