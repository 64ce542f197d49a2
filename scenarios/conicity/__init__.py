"""Wheel-rail pairs by EN 15302: radius difference, equivalent conicity, and the norm's test."""
