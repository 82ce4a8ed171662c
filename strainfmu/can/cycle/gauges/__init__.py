"""The judgement of each gauge by its values: range, jumps, noise, freezing; and its verdict."""
