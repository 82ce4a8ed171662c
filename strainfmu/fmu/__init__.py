"""Packaging of FMUs: the model description, the documentation and the export itself."""
