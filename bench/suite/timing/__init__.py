"""Timing adapters: fresh processes that take turns, their durations, and what is stored of them."""
