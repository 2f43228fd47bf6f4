"""Exports of data sets for other libraries."""
