"""The resource of the native FMU: rolling moment and section loads are a part of its own."""

import numpy as np
import pytest
from other_load_maps import with_further
from random_map import map_of, random_model
from scaled_maps import whole_scaled_map

from strainfmu.estimator.resource.map_file import map_arrays, native_resource

pytestmark = pytest.mark.fast


@pytest.mark.parametrize("case", [1, 2])
def test_other_loads_leave_the_rest_unchanged(case: int) -> None:
    plain = whole_scaled_map(case, 3)
    before, after = map_arrays(plain), map_arrays(with_further(plain))
    assert {name.split(".")[0] for name in after.keys() - before.keys()} == {"other_loads"}
    for name, array in before.items():
        np.testing.assert_array_equal(after[name], array, err_msg=name)


def test_form_absolute_has_no_such_part() -> None:
    plain = map_of(random_model(gamma=0.7, n_gauges=18))
    assert native_resource(with_further(plain), "guid") == native_resource(plain, "guid")
