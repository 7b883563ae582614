"""The measurements as tables and pictures."""
