"""Fuzzing of everything that Carom reads: mutations of good inputs, each tried in a child process.

`mutate` makes damaged inputs, `targets` says what is done with one and what may come of it, `pool` runs that in
processes whose memory and time are limited. `tests/test_fuzz.py` is the tests, `corpus` holds inputs that were once
trouble. `python -m fuzz TARGET SECONDS` in `tests` goes on for as long as one likes.
"""
