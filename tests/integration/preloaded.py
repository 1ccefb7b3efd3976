"""Loads what commands load once a mission speaks or sees: the server that commands are forked from has it already."""

import gc

import scipy.signal
import scipy.stats  # noqa: F401  loaded for its children

from harness.adapters.providers.speech import recogniser

recogniser.dictionary()
gc.freeze()
