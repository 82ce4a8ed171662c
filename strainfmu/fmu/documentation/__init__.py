"""Pages inside the FMUs: what they compute, where it holds, and figures of the reference run."""
