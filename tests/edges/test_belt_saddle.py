"""Friction of the saddles under the fast step: it sticks where its slope alone would chatter from step to step.

The slope of saturated friction is 0, so that a step by the slope throws a speed v to v - F step / m. In one station
of rings and elements that go and come by v = x v_ring at every step

    2 x (1 + s(x)) = lambda tanh x,    lambda = mu_r T kappa (1 / m_0 + 1 / m_1) step / v_ring,

s being the slope's share as the step takes it: from lambda = 4.9 on such a chatter exists. The fast step solves again,
by the secant, where sliding would turn about, and stays quiet at any lambda.
"""

import numpy as np
import pytest
from belts import point

from cvt_hpc.models.elastic_belt.batch import Batch
from cvt_hpc.models.elastic_belt.belt import belt_constants
from cvt_hpc.models.elastic_belt.record import judge
from cvt_hpc.vibration.classes import OccurrenceClass, classify_runs

RATIOS = {0.7: 63.89e-3 * 0.7 / 0.7, 1.0: 55.90e-3}
