"""Experiments with published or exact answers: studies, benchmarks and exact solutions."""
