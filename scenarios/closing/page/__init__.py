"""What stands on the report's page: names, sentences and tables."""
