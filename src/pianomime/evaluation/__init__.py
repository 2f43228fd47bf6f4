"""Scoring: many songs at a time, and why notes of a performance went wrong."""
