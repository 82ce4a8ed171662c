"""Random linear Gaussian models of candidate gauges, and rules for them."""

import numpy as np
from scipy.sparse import csr_array

from builder.placement.gaussian_model import Criterion, GaussianModel
from builder.placement.limits import Rules


def random_model(seed: int, n_sites: int = 12, b: int = 1, criterion: Criterion = "trace") -> GaussianModel:
    random = np.random.default_rng(seed)
    n_s, m, n_g = 3, 6, 3
    return GaussianModel(
        rows=random.standard_normal((n_s, n_sites, b, m)),
        precision=np.tile(np.diag(random.uniform(0.5, 2.0, m)), (n_s, 1, 1)),
        goals=random.standard_normal((n_s, n_g, m)),
        fixed=np.full((n_s, n_g), 0.1),
        weight=np.array([0.5, 0.3, 0.2]),
        criterion=criterion,
    )


def count_rules(model: GaussianModel, count: int) -> Rules:
    n, b = model.rows.shape[1:3]
    return Rules(cost=np.full(n, float(b)), budget=float(b * count), excludes=csr_array((n, n)))
