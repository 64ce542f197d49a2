"""The command `fleet`: thousands of records of many vehicles through check, estimate and close-loop."""
