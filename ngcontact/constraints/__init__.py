"""Supports and contact rows as arrays, and the basis in which each is one unknown. Arrays only."""
