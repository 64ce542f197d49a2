"""Importers of FMUs that others wrote, one file each."""
