"""Detectable bias: how large a bias of one gauge must be to raise an alarm, and to be attributed to that gauge."""

from strainfmu.estimator.alarm_limits import detectable_noncentrality as detectable_noncentrality
from strainfmu.estimator.alarm_limits import minimal_detectable_bias as minimal_detectable_bias
from strainfmu.estimator.alarm_limits import minimal_isolable_bias as minimal_isolable_bias
from strainfmu.estimator.alarm_limits import noncentral_survival as noncentral_survival
