"""The inverse problem, from strain to pressure states and loads: modes, priors, both cases, noise, uncertainty."""
