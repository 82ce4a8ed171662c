"""Packaging of FMUs: what they state, hold and document, the export itself, and checks of finished ones."""
